// The user's options from the command line.
#pragma once

#include <optional>
#include <variant>

#include "server/cli/accounts/design.hpp"
#include "server/cli/accounts/fluid.hpp"
#include "server/cli/accounts/job.hpp"
#include "server/cli/accounts/robot.hpp"
#include "server/cli/accounts/token.hpp"
#include "server/cli/accounts/user.hpp"
#include "server/cli/analysis/capsule.hpp"
#include "server/cli/analysis/compare.hpp"
#include "server/cli/analysis/impedance_map.hpp"
#include "server/cli/analysis/metrics.hpp"
#include "server/cli/analysis/report.hpp"
#include "server/cli/commission/commission.hpp"
#include "server/cli/data/backup.hpp"
#include "server/cli/data/certificate.hpp"
#include "server/cli/data/export.hpp"
#include "server/cli/data/reference.hpp"
#include "server/cli/data/reproduce.hpp"
#include "server/cli/data/restore.hpp"
#include "server/cli/data/run.hpp"
#include "server/cli/data/verify.hpp"
#include "server/cli/design/bode.hpp"
#include "server/cli/design/discretise.hpp"
#include "server/cli/design/estimator.hpp"
#include "server/cli/design/identify.hpp"
#include "server/cli/design/model.hpp"
#include "server/cli/design/predict.hpp"
#include "server/cli/design/profile.hpp"
#include "server/cli/design/step.hpp"
#include "server/cli/design/tune.hpp"
#include "server/cli/experiments/autotune.hpp"
#include "server/cli/experiments/demo.hpp"
#include "server/cli/experiments/experiment.hpp"
#include "server/cli/health/doctor.hpp"
#include "server/cli/health/support_bundle.hpp"
#include "server/cli/reference_pages.hpp"
#include "server/cli/robots/login_link.hpp"
#include "server/cli/robots/stop.hpp"
#include "server/cli/robots/watch.hpp"
#include "server/cli/terminal/output.hpp"
#include "server/config/config.hpp"

namespace server::cli {

struct Serve {
  config::ConfigFlags flags;
};

struct CheckConfig {
  config::ConfigFlags flags;
  OutputForm form;
};

// The user was answered already (--help, --version, or a mistake that was explained).
struct Answered {
  int exit_code = 0;
};

using CommandLine =
    std::variant<Answered, Serve, CheckConfig, Certificate, Backup, Restore, Verify, Export, Model, Bode, Step,
                 Identify, EstimatorQuestion, Tune, Discretise, Predict, UserCommand, TokenCommand, RobotCommand,
                 FluidCommand, JobCommand, DesignCommand, MetricsQuestion, CompareQuestion, ImpedanceMapQuestion,
                 ReportQuestion, CapsuleQuestion, Reproduce, RunCommand, ReferenceCommand, ProfileQuestion,
                 ExperimentCommand, Autotune, Demo, StopCommand, WatchCommand, Doctor, SupportBundle, Commission,
                 LoginLink, CompletionCommand, ManualCommand>;

// The program with all its commands; the one that is chosen when `app` parses becomes `line`.
void define_command_line(CLI::App& app, CommandLine& line);

CommandLine parse_command_line(int argc, char** argv);

// Does everything but to serve, and returns the exit code; none for Serve. Writes to `out` only what is complete, but
// for `stop`, which writes its outcome at once.
// Options that do not go together are explained on standard error. Throws what the tools throw: a sentence for the
// user.
std::optional<int> answer(const CommandLine& line, std::ostream& out);
std::optional<int> answer(const CommandLine& line);  // on standard output

// Define the command line once more, and write what follows from it.
int run(const CompletionCommand& line, std::ostream& out);
int run(const ManualCommand& line, std::ostream& out);

// Reads and checks a configuration, and prints what it means.
int run(const CheckConfig& line, std::ostream& out);

}  // namespace server::cli
