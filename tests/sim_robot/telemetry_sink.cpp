// Welcomes, counts and acknowledges.
#include "tests/sim_robot/telemetry_sink.hpp"

#include <algorithm>
#include <array>
#include <boost/asio/write.hpp>

namespace sim_robot {

namespace asio = boost::asio;
using asio::ip::tcp;
using Clock = std::chrono::steady_clock;

struct TelemetrySink::Session {
  explicit Session(tcp::socket connection) : socket(std::move(connection)) {}

  tcp::socket socket;
  std::array<std::uint8_t, 8192> bytes{};
  protocol::FrameReader reader;
  StoredBoot* boot = nullptr;  // in boots_, after its hello
  Clock::time_point acknowledged_at;
};

void StoredBoot::store(std::uint64_t first_seq, std::uint64_t end_seq, std::uint64_t oldest_seq) {
  std::uint64_t known = 0, joined_first = first_seq, joined_end = end_seq;
  auto run = runs.upper_bound(first_seq);
  if (run != runs.begin() && std::prev(run)->second >= first_seq) --run;
  while (run != runs.end() && run->first <= end_seq) {
    const std::uint64_t from = std::max(first_seq, run->first), to = std::min(end_seq, run->second);
    known += to > from ? to - from : 0;
    joined_first = std::min(joined_first, run->first);
    joined_end = std::max(joined_end, run->second);
    run = runs.erase(run);
  }
  runs[joined_first] = joined_end;
  samples += end_seq - first_seq - known;
  repeated += known;
  pass_over_gaps(oldest_seq);
}

// What the robot gave up below its oldest sample will never come.
void StoredBoot::pass_over_gaps(std::uint64_t oldest_seq) {
  for (const auto& [first, end] : runs) {
    if (first > next_seq && next_seq < oldest_seq) {
      const std::uint64_t given_up_to = std::min(first, oldest_seq);
      missing += given_up_to - next_seq;
      next_seq = given_up_to;
    }
    if (first > next_seq) return;
    next_seq = std::max(next_seq, end);
  }
}

TelemetrySink::TelemetrySink(asio::io_context& loop, std::uint16_t port) : reserved_(loop), acceptor_(loop) {
  bind(reserved_, port);
  open();
}

TelemetrySink::~TelemetrySink() { close(); }

void TelemetrySink::bind(tcp::acceptor& acceptor, std::uint16_t port) {
  const tcp::endpoint endpoint{asio::ip::address_v4::loopback(), port};
  acceptor.open(endpoint.protocol());
  acceptor.set_option(tcp::acceptor::reuse_address{true});
  acceptor.bind(endpoint);
}

void TelemetrySink::open() {
  bind(acceptor_, port());
  acceptor_.listen();
  accept();
}

void TelemetrySink::close() {
  boost::system::error_code ignored;
  acceptor_.close(ignored);
  for (const auto& session : sessions_) session->socket.close(ignored);
  sessions_.clear();
}

void TelemetrySink::accept() {
  acceptor_.async_accept([this](const boost::system::error_code& error, tcp::socket socket) {
    if (error) return;
    socket.set_option(tcp::no_delay{true});
    const auto session = std::make_shared<Session>(std::move(socket));
    sessions_.insert(session);
    read(session);
    accept();
  });
}

void TelemetrySink::read(const std::shared_ptr<Session>& session) {
  session->socket.async_read_some(asio::buffer(session->bytes),
                                  [this, session](const boost::system::error_code& error, std::size_t size) {
                                    if (error == asio::error::operation_aborted) return;
                                    if (!error && take(*session, size)) return read(session);
                                    boost::system::error_code ignored;
                                    session->socket.close(ignored);
                                    sessions_.erase(session);
                                  });
}

bool TelemetrySink::take(Session& session, std::size_t size) {
  protocol::Bytes input{session.bytes.data(), size};
  while (!input.empty() && session.reader.push(input) == protocol::FrameReader::State::complete) {
    const auto frame = protocol::decode_robot_frame(session.reader.payload());
    if (!frame || !take_frame(session, *frame)) return false;
  }
  return true;
}

bool TelemetrySink::take_frame(Session& session, const protocol::RobotFrame& frame) {
  ++frames_;
  if (frame.which_body == rheonaut_RobotFrame_hello_tag) return welcome(session, frame.body.hello);
  if (session.boot == nullptr) return false;
  StoredBoot& boot = *session.boot;
  if (on_frame) on_frame(frame, boot.robot_id);
  if (frame.which_body == rheonaut_RobotFrame_telemetry_tag) {
    const protocol::Telemetry& batch = frame.body.telemetry;
    boot.store(batch.first_seq, batch.first_seq + batch.position_m_count, batch.oldest_seq);
    if ((batch.flags & rheonaut_TELEMETRY_FLAG_BACKFILL) != 0) ++boot.backfill_frames;
  }
  if (frame.which_body == rheonaut_RobotFrame_command_ack_tag &&
      frame.body.command_ack.result == rheonaut_COMMAND_RESULT_REJECTED) {
    ++boot.refused_commands;
  }
  if (Clock::now() - session.acknowledged_at >= acks_every) acknowledge(session);
  return true;
}

bool TelemetrySink::welcome(Session& session, const protocol::Hello& hello) {
  protocol::StationFrame answer = rheonaut_StationFrame_init_zero;
  answer.which_body = rheonaut_StationFrame_welcome_tag;
  answer.body.welcome.protocol_version = protocol::kProtocolVersion;
  if (refused.contains(hello.robot_id)) {
    answer.body.welcome.refusal = rheonaut_REFUSAL_REASON_UNKNOWN_ROBOT;
    send(session, answer);
    return true;  // the robot closes
  }
  session.boot = &boots_[hello.boot_id];
  session.boot->robot_id = hello.robot_id;
  ++session.boot->connections;
  session.acknowledged_at = Clock::now();
  answer.body.welcome.link_timeout_ms = link_timeout_ms;
  if (acknowledges) answer.body.welcome.durable_next_seq = session.boot->next_seq;
  send(session, answer);
  return true;
}

void TelemetrySink::acknowledge(Session& session) {
  session.acknowledged_at = Clock::now();
  const StoredBoot& boot = *session.boot;
  protocol::StationFrame frame = rheonaut_StationFrame_init_zero;
  frame.which_body = rheonaut_StationFrame_heartbeat_tag;
  if (acknowledges) frame.body.heartbeat.durable_next_seq = boot.next_seq;
  if (acknowledges) {
    const auto next_run = boot.runs.upper_bound(boot.next_seq);
    if (next_run != boot.runs.end()) {
      frame.body.heartbeat.resend_first_seq = boot.next_seq;
      frame.body.heartbeat.resend_next_seq = next_run->first;
    }
  }
  send(session, frame);
}

void TelemetrySink::send(Session& session, const protocol::StationFrame& frame) {
  std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes;
  const std::size_t size = protocol::write_frame(frame, bytes.data(), bytes.size());
  boost::system::error_code ignored;  // the read notices
  asio::write(session.socket, asio::buffer(bytes.data(), size), ignored);
}

void TelemetrySink::send_all(const protocol::StationFrame& frame) {
  for (const auto& session : sessions_) send(*session, frame);
}

std::uint64_t TelemetrySink::samples() const {
  std::uint64_t sum = 0;
  for (const auto& [id, boot] : boots_) sum += boot.samples;
  return sum;
}

}  // namespace sim_robot
