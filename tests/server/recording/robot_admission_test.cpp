// The admission of robots by itself: questions go to the database together, and nobody waits for ever.
#include "server/storage/ingest/robot_admission.hpp"

#include <gtest/gtest.h>

#include <boost/asio/co_spawn.hpp>
#include <map>
#include <stdexcept>
#include <string>

namespace server {
namespace {

namespace asio = boost::asio;

class RobotAdmissionTest : public ::testing::Test {
 protected:
  // A database that answers when the test lets it.
  asio::awaitable<std::vector<storage::AdmissionOutcome>> answer(std::vector<storage::AdmissionQuestion> questions) {
    asked_.push_back(questions.size());
    co_await let_answer_.wait();
    if (fails_once_) {
      fails_once_ = false;
      throw std::runtime_error{"no disk"};
    }
    std::vector<storage::AdmissionOutcome> outcomes(questions.size());
    for (std::size_t at = 0; at < questions.size(); ++at)
      outcomes[at].admission.detail = questions[at].request.robot_id;
    co_return outcomes;
  }
  void ask(const station::RobotId& robot_id) {
    storage::AdmissionQuestion question;
    question.request.robot_id = robot_id;
    asio::co_spawn(loop_, admission_.ask(question),
                   [this, robot_id](std::exception_ptr error, storage::AdmissionOutcome outcome) {
                     answers_[robot_id] = error ? "error" : outcome.admission.detail;
                     refusals_[robot_id] = outcome.admission.refusal;
                   });
    settle();
  }
  void let_answer() {
    let_answer_.notify();
    settle();
  }
  void settle() {
    loop_.restart();
    loop_.poll();
  }

  asio::io_context loop_{1};
  runtime::Signal let_answer_{loop_};
  std::vector<std::size_t> asked_;  // how many questions each time
  bool fails_once_ = false;
  std::map<station::RobotId, std::string> answers_;
  std::map<station::RobotId, protocol::RefusalReason> refusals_;
  storage::RobotAdmission admission_{
      loop_, [this](std::vector<storage::AdmissionQuestion> all) { return answer(std::move(all)); }};
};

TEST_F(RobotAdmissionTest, AsksTogetherForAllThatCameMeanwhile) {
  for (const char* robot : {"a", "b", "c"}) ask(robot);
  EXPECT_EQ(asked_, (std::vector<std::size_t>{1}));
  let_answer();
  EXPECT_EQ(asked_, (std::vector<std::size_t>{1, 2}));
  EXPECT_EQ(answers_, (std::map<station::RobotId, std::string>{{"a", "a"}}));
  let_answer();
  EXPECT_EQ(answers_, (std::map<station::RobotId, std::string>{{"a", "a"}, {"b", "b"}, {"c", "c"}}));
}

TEST_F(RobotAdmissionTest, AFailedAdmissionLeavesTheOthersTheirAnswer) {
  fails_once_ = true;
  for (const char* robot : {"a", "b"}) ask(robot);
  let_answer();
  EXPECT_EQ(answers_["a"], "error");
  let_answer();
  EXPECT_EQ(answers_["b"], "b");
}

TEST_F(RobotAdmissionTest, ARobotThatIsRevokedMeanwhileIsRefused) {
  ask("a");
  admission_.set_revoked("a", true);
  let_answer();
  EXPECT_EQ(refusals_["a"], rheonaut_REFUSAL_REASON_WRONG_TOKEN);
  admission_.set_revoked("a", false);
  ask("a");
  let_answer();
  EXPECT_EQ(refusals_["a"], rheonaut_REFUSAL_REASON_NONE);
}

}  // namespace
}  // namespace server
