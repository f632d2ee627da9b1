#include "server/storage/ingest/robot_admission.hpp"

#include <spdlog/spdlog.h>

#include <utility>

namespace server::storage {
namespace asio = boost::asio;

class RobotAdmission::Turn {
 public:
  explicit Turn(RobotAdmission& of) : admission_{of} { admission_.is_asking_ = true; }
  ~Turn() {
    admission_.is_asking_ = false;
    for (const auto& question : admission_.questions_) question->answered.notify();
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  RobotAdmission& admission_;
};

asio::awaitable<AdmissionOutcome> RobotAdmission::ask(AdmissionQuestion question) {
  const auto mine = std::make_shared<Question>(loop_, std::move(question));
  questions_.push_back(mine);
  while (!mine->outcome) {
    if (is_asking_) {
      co_await mine->answered.wait();
    } else {
      co_await ask_for_all();
    }
  }
  check_revoked(*mine->outcome, mine->question.request);
  co_return std::move(*mine->outcome);
}

asio::awaitable<void> RobotAdmission::ask_for_all() {
  const Turn turn{*this};
  std::vector<AdmissionQuestion> questions;
  questions.reserve(questions_.size());
  for (const auto& waiting : questions_) questions.push_back(waiting->question);
  auto outcomes = co_await ask_database_(std::move(questions));
  for (AdmissionOutcome& outcome : outcomes) {
    questions_.front()->outcome = std::move(outcome);
    questions_.front()->answered.notify();
    questions_.pop_front();
  }
}

void RobotAdmission::set_revoked(const station::RobotId& robot_id, bool revoked) {
  revoked ? static_cast<void>(revoked_.insert(robot_id)) : static_cast<void>(revoked_.erase(robot_id));
}

void RobotAdmission::check_revoked(AdmissionOutcome& outcome, const station::AdmissionRequest& request) const {
  if (outcome.admission.refusal != rheonaut_REFUSAL_REASON_NONE) return;
  if (revoked_.contains(request.robot_id)) {  // since the disk was asked
    outcome.admission = revoked(request.robot_id);
  } else if (outcome.admission.newly_enrolled) {
    spdlog::info("robot '{}' enrolled from loopback {} a token", request.robot_id,
                 request.token.empty() ? "without" : "with");
  }
}

}  // namespace server::storage
