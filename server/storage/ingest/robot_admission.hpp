// Asks the database whether robots may connect: puts their questions together, and refuses who was revoked meanwhile.
//
// Those who ask while the disk is busy are answered together: a thousand new robots are not a thousand commits. One of
// them asks for all that are there; when it has ended, whatever came of it, another one asks for those that came later.
//
// Loop thread; owned by the Recorder. The loop outlives it. An exception of the function that asks the database reaches
// the robot that asked for all; the others ask again.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/storage/commits/boot_store.hpp"

namespace server::storage {

class RobotAdmission {
 public:
  // One outcome for each question, in order: BootStore::admit on the disk thread.
  using AskDatabase =
      std::function<boost::asio::awaitable<std::vector<AdmissionOutcome>>(std::vector<AdmissionQuestion>)>;

  RobotAdmission(boost::asio::io_context& loop, AskDatabase ask_database)
      : loop_{loop}, ask_database_{std::move(ask_database)} {}

  boost::asio::awaitable<AdmissionOutcome> ask(AdmissionQuestion question);

  // A robot whose enrolment was revoked is refused from this call on, also one that is being asked for.
  void set_revoked(const station::RobotId& robot_id, bool revoked);

 private:
  // A robot that waits for its answer. Shared with it, since its coroutine may be cancelled.
  struct Question {
    Question(boost::asio::io_context& loop, AdmissionQuestion asked) : question{std::move(asked)}, answered{loop} {}
    AdmissionQuestion question;
    std::optional<AdmissionOutcome> outcome;
    runtime::Signal answered;  // or nobody asks any more
  };
  // One coroutine asks at a time; when it ends, all that wait are woken.
  class Turn;

  boost::asio::awaitable<void> ask_for_all();
  void check_revoked(AdmissionOutcome& outcome, const station::AdmissionRequest& request) const;

  boost::asio::io_context& loop_;
  AskDatabase ask_database_;
  std::deque<std::shared_ptr<Question>> questions_;  // as many as robots are greeted at a time
  bool is_asking_ = false;
  std::set<station::RobotId> revoked_;  // as in the database, or newer; all of them were enrolled
};

}  // namespace server::storage
