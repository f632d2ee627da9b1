// Cuts a recording into tails and writes heads before them.
#include "sim_robot/fleet/replay.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "base/invalid_argument.hpp"
#include "base/whole_file.hpp"
#include "sim_robot/lab/station_peer.hpp"

namespace sim_robot {
namespace {

constexpr std::uint8_t kTimeTag = 0x08, kTelemetryTag = 0x22;                         // of RobotFrame
constexpr std::uint8_t kFirstSeqTag = 0x08, kFirstTimeTag = 0x10, kPeriodTag = 0x18;  // of Telemetry
constexpr std::uint8_t kOldestSeqTag = 0x20, kFlagsTag = 0x60;
constexpr std::size_t kMaxHeadBytes = 64;  // five varints of 10 bytes with their tags

constexpr std::size_t kMaxTailBytes = protocol::kMaxFrameBytes - 2 * kMaxHeadBytes;

std::uint8_t* put_varint(std::uint8_t* out, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) *out++ = static_cast<std::uint8_t>(value | 0x80);
  *out++ = static_cast<std::uint8_t>(value);
  return out;
}

std::uint8_t* put_field(std::uint8_t* out, std::uint8_t tag, std::uint64_t value) {
  if (value == 0) return out;
  *out++ = tag;
  return put_varint(out, value);
}

// The bytes behind a tag of one byte and a length.
protocol::Bytes inner(protocol::Bytes message) {
  message.drop(1);
  while ((*message.first & 0x80) != 0) message.drop(1);
  message.drop(1);
  return message;
}

void put_batch_values(const ReceivedSample& sample, protocol::Telemetry& batch) {
  batch.period_us = SimulatedRobot::kPeriodUs;
  batch.mode = sample.mode;
  batch.sub_state = sample.sub_state;
  batch.has_setpoint_m = sample.setpoint_m.has_value();
  batch.setpoint_m = sample.setpoint_m.value_or(0.0F);
  batch.disturbance_m = sample.disturbance_m;
  batch.position_sd_m = sample.position_sd_m;
  batch.controller_id = sample.controller_id;
  batch.flags = sample.flags;
}

// Frames of equal length, with the batch values of their first samples; the rest that fills none is left out.
std::vector<std::uint8_t> rebatched(const std::map<std::uint64_t, ReceivedSample>& samples, std::uint32_t per_frame) {
  std::vector<std::uint8_t> stream;
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_telemetry_tag;
  protocol::Telemetry& batch = frame.body.telemetry;
  for (const auto& [seq, sample] : samples) {
    const pb_size_t at = batch.position_m_count;
    if (at == 0) put_batch_values(sample, batch);
    batch.position_m[at] = sample.position_m;
    batch.velocity_m_s[at] = sample.velocity_m_s;
    batch.acceleration_m_s2[at] = sample.acceleration_m_s2;
    batch.duty[at] = sample.duty;
    batch.impedance_mv[at] = sample.impedance_mv;
    batch.reference_m[at] = sample.reference_m;
    batch.velocity_m_s_count = batch.acceleration_m_s2_count = batch.duty_count = at + 1;
    batch.position_m_count = batch.impedance_mv_count = batch.reference_m_count = at + 1;
    if (at + 1U < per_frame) continue;
    std::array<std::uint8_t, protocol::kMaxFramedBytes> bytes;
    const std::size_t size = protocol::write_frame(frame, bytes.data(), bytes.size());
    stream.insert(stream.end(), bytes.data(), bytes.data() + size);
    batch = rheonaut_Telemetry_init_zero;
  }
  return stream;
}

}  // namespace

Recording::Recording(protocol::Bytes stream) {
  protocol::FrameReader reader;
  while (!stream.empty()) {
    const auto state = reader.push(stream);
    if (state == protocol::FrameReader::State::incomplete) break;  // it was cut off while it was recorded
    const auto frame =
        state == protocol::FrameReader::State::complete ? protocol::decode_robot_frame(reader.payload()) : std::nullopt;
    if (!frame) base::throw_invalid("recording: frame ", frames_.size(), " of telemetry is none of this protocol");
    const bool is_live = frame->which_body == rheonaut_RobotFrame_telemetry_tag &&
                         (frame->body.telemetry.flags & rheonaut_TELEMETRY_FLAG_BACKFILL) == 0;
    if (is_live) add(frame->body.telemetry);
  }
  if (frames_.empty()) base::throw_invalid("recording: there is no telemetry in it");
}

// A frame without time and without the fields of the head is encoded as its tail.
void Recording::add(const protocol::Telemetry& batch) {
  if (frames_.empty()) period_us_ = batch.period_us;
  protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
  frame.which_body = rheonaut_RobotFrame_telemetry_tag;
  frame.body.telemetry = batch;
  frame.body.telemetry.first_seq = frame.body.telemetry.first_robot_time_us = 0;
  frame.body.telemetry.period_us = 0;
  frame.body.telemetry.oldest_seq = 0;
  std::array<std::uint8_t, protocol::kMaxFrameBytes> bytes;
  const protocol::Bytes tail = inner({bytes.data(), protocol::encode(frame, bytes.data(), bytes.size())});
  if (tail.size > kMaxTailBytes) base::throw_invalid("recording: a frame of telemetry is too long, ", tail.size);
  frames_.push_back({samples_, batch.flags, tails_.size(), tail.size});
  tails_.insert(tails_.end(), tail.begin(), tail.end());
  samples_ += batch.position_m_count;
}

std::uint64_t Recording::first_seq(std::uint64_t number) const {
  return number / frames() * samples_ + frames_[number % frames()].first_seq;
}

std::uint64_t Recording::frame_of(std::uint64_t seq) const {
  const auto after = std::upper_bound(frames_.begin(), frames_.end(), seq % samples_,
                                      [](std::uint64_t value, const Frame& frame) { return value < frame.first_seq; });
  return seq / samples_ * frames() + static_cast<std::uint64_t>(after - frames_.begin()) - 1;
}

std::size_t Recording::write(std::uint64_t number, const Head& head, std::uint8_t* out, std::size_t capacity) const {
  const Frame& frame = frames_[number % frames()];
  const std::uint64_t seq = first_seq(number);
  std::array<std::uint8_t, kMaxHeadBytes> fields, start, flags;
  std::uint8_t* fields_end = put_field(fields.data(), kFirstSeqTag, seq);
  fields_end = put_field(fields_end, kFirstTimeTag, seq * head.period_us);
  fields_end = put_field(fields_end, kPeriodTag, head.period_us);
  fields_end = put_field(fields_end, kOldestSeqTag, head.oldest_seq);
  std::uint8_t* flags_end = flags.data();
  if (head.is_sent_again) {
    flags_end = put_field(flags_end, kFlagsTag, frame.flags | rheonaut_TELEMETRY_FLAG_BACKFILL);
  }
  const auto fields_size = static_cast<std::size_t>(fields_end - fields.data());
  const auto flags_size = static_cast<std::size_t>(flags_end - flags.data());

  std::uint8_t* start_end = put_field(start.data(), kTimeTag, head.robot_time_us);
  *start_end++ = kTelemetryTag;
  start_end = put_varint(start_end, fields_size + frame.tail_size + flags_size);
  const auto start_size = static_cast<std::size_t>(start_end - start.data());

  const std::size_t payload_size = start_size + fields_size + frame.tail_size + flags_size;
  if (payload_size > protocol::kMaxFrameBytes || payload_size + protocol::kMaxPrefixBytes > capacity) return 0;
  std::uint8_t* end = put_varint(out, payload_size);
  end = std::copy_n(start.data(), start_size, end);
  end = std::copy_n(fields.data(), fields_size, end);
  end = std::copy_n(tails_.data() + frame.tail_start, frame.tail_size, end);
  end = std::copy_n(flags.data(), flags_size, end);
  return static_cast<std::size_t>(end - out);
}

Recording load_recording(const std::filesystem::path& path) {
  constexpr std::size_t kMaxBytes = 1 << 30;  // a day of one robot, or more
  const base::WholeFile whole = base::read_whole(path, kMaxBytes);
  if (!whole.problem.empty()) base::throw_invalid("recording: ", path.string(), " ", whole.problem);
  return Recording{{reinterpret_cast<const std::uint8_t*>(whole.text.data()), whole.text.size()}};
}

Recording make_recording(double seconds, std::uint32_t samples_per_frame, std::uint64_t seed) {
  constexpr float kSetpointM = 0.1F;
  SimulatedRobotConfig config;
  config.world.imu.emplace();
  config.world.seed = seed;
  SimulatedRobot robot{config};
  StationPeer peer{robot};
  peer.connect();
  peer.run(1);
  peer.send(set_auto(kSetpointM));
  peer.run(static_cast<int>(std::lround(seconds / SimulatedRobot::kPeriodS)));
  const std::vector<std::uint8_t> stream = rebatched(peer.samples, samples_per_frame);
  return Recording{{stream.data(), stream.size()}};
}

std::uint32_t replay_period_us(const Recording& recording, double rate) {
  const double period_us = std::round(recording.period_us() / rate);
  if (!(rate > 0) || !(period_us >= 100 && period_us <= 10e6)) {
    base::throw_invalid("--rate must make the sample period 0.1 ms to 10 s, is ", rate, " for a period of ",
                        recording.period_us(), " us");
  }
  return static_cast<std::uint32_t>(period_us);
}

}  // namespace sim_robot
