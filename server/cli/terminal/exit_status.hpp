// What the exit status of a command means: the one table, which the manual pages print and docs/commands.md repeats.
#pragma once

#include <stdexcept>

#include "base/failures/words.hpp"

namespace server::cli {

struct ExitStatus {
  int code;
  const char* meaning;
};

inline constexpr int kFailed = 1;

inline constexpr ExitStatus kExitStatuses[] = {
    {0, "done"},
    {kFailed,
     "an error, with one line on standard error; identify: also a search that reached --time-limit-s, which "
     "leaves no model; verify: faults were found; reproduce: a file is damaged or a number differs"},
    {2,
     "the command line is wrong: an unknown command or option, a value that is not allowed, options that exclude each "
     "other; verify, reproduce: the file is not what the command reads"},
    {3,
     "tune, autotune: no controller meets the specification; estimator: the robot cannot use a model of this plant; "
     "profile: a predicted run leaves the limits"},
    {4,
     "identify: the search did not converge, its result is not finite, or the model explains less than 1 % of every "
     "run; the best result is printed"},
    {5,
     "not confirmed, or it did not end well: stop: a robot has not confirmed; robot parameters, robot controller, "
     "robot "
     "fluid --model: accepted, but not reported back; job, experiment: failed, cancelled, aborted or interrupted; "
     "autotune: a stage "
     "did not end well; robot commission: the record is not signed"},
};

// Options that do not go together, or a value that another option makes impossible: exit status 2.
class UsageError : public std::runtime_error, public base::failures::Worded {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace server::cli
