// What the user asked for on the command line.
#pragma once

#include <optional>
#include <variant>

#include "server/cli/backup.hpp"
#include "server/cli/bode.hpp"
#include "server/cli/certificate.hpp"
#include "server/cli/discretise.hpp"
#include "server/cli/estimator.hpp"
#include "server/cli/export.hpp"
#include "server/cli/fluid.hpp"
#include "server/cli/identify.hpp"
#include "server/cli/model.hpp"
#include "server/cli/predict.hpp"
#include "server/cli/reference.hpp"
#include "server/cli/restore.hpp"
#include "server/cli/robot.hpp"
#include "server/cli/step.hpp"
#include "server/cli/token.hpp"
#include "server/cli/tune.hpp"
#include "server/cli/user.hpp"
#include "server/cli/verify.hpp"
#include "server/config.hpp"

namespace server::cli {

struct Serve {
  ConfigFlags flags;
};

struct CheckConfig {
  ConfigFlags flags;
};

// The user was answered already (--help, --version, or a mistake that was explained).
struct Answered {
  int exit_code = 0;
};

using Wish = std::variant<Answered, Serve, CheckConfig, Certificate, Backup, Restore, Verify, Export, Model, Bode, Step,
                          Identify, EstimatorQuestion, Tune, Discretise, Predict, UserCommand, TokenCommand,
                          RobotCommand, FluidCommand, ReferenceCommand>;

Wish parse_command_line(int argc, char** argv);

// Does everything but to serve, and returns the exit code; none for Serve. Writes to `out` only what is complete.
// Throws what the tools throw: a sentence for the user.
std::optional<int> answer(const Wish& wish, std::ostream& out);

// Reads and checks a configuration, and prints what it means.
int run(const CheckConfig& wish, std::ostream& out);

}  // namespace server::cli
