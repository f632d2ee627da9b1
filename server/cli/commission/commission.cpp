// Options, the steps, the signature, the record.
#include "server/cli/commission/commission.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <boost/asio/io_context.hpp>
#include <stdexcept>

#include "server/cli/commission/commissioning.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/input.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/exceptions.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

json answers_of(const Commission& options) {
  json answers = json::object();
  if (options.answers) {
    answers = read_json(options.answers->string());
    if (!answers.is_object()) {
      throw UsageError{fmt::format("'{}' is not a JSON object of answers", options.answers->string())};
    }
  }
  if (options.signed_by) answers["signed_by"] = *options.signed_by;
  return answers;
}

std::int64_t now_us() {
  boost::asio::io_context loop;
  return runtime::SystemClock{loop}.utc_us();
}

// Who answers for it. Nobody can for what failed or was left out.
void sign(CommissionRecord& record, Person& person) {
  record.unsigned_because = unsigned_reason(record);
  if (!record.unsigned_because.empty()) return;
  try {
    record.signed_by = person.text("signed_by", "Who signs this record? (your name; Enter: nobody)");
  } catch (const Interrupted&) {
  } catch (const Declined&) {
  }
  if (record.signed_by.empty()) record.unsigned_because = "nobody gave a name";
}

std::string sum_up(const CommissionRecord& record) {
  if (!record.signed_by.empty()) return fmt::format("{}, signed by {}", outcome_of(record), record.signed_by);
  return fmt::format("{}, NOT SIGNED: {}", outcome_of(record), record.unsigned_because);
}

void write_as_text(std::ostream& out, const CommissionRecord& record, const WrittenRecord& written,
                   const std::string& not_marked) {
  Table table{{"step", "<verdict", "<what to do"}};
  for (const StepFinding& one : record.findings) table.row({one.step, text(one.verdict), one.action});
  table.write(out);
  fmt::print(out, "{}: {}\nrecord: {}\nsha256: {}\n", record.robot_id, sum_up(record), written.folder.string(),
             written.sha256);
  if (!not_marked.empty()) fmt::print(out, "the station has not noted it: {}\n", not_marked);
}

}  // namespace

void add_options(CLI::App& command, Commission& options) {
  command.add_option("robot_id", options.robot_id, "The robot")->required()->check(named());
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  command.add_option("--into", options.into, "In it the record gets a folder of its own (default: here)")
      ->check(named())
      ->type_name("FOLDER");
  command.add_option("--duty", options.largest_duty, "Largest duty of the motor (default: 0.3)")
      ->check(from_to(0.05, 0.5));
  command.add_option("--signed-by", options.signed_by, "Who signs the record (default: asked for)")->check(named());
  command
      .add_option(
          "--answers", options.answers,
          "JSON object with the answers: free_ahead_m, free_behind_m, direction, moved_m, set_dead_zone, signed_by")
      ->check(named());
  command.add_flag("--yes", options.says_yes, "Confirm every step beforehand: for a rehearsal on a simulated robot");
  add_json_flag(command, options.form);
  command.footer(
      "The stops come first, with the motor off; the motor then gets small duties for\n"
      "short times. Ctrl-C ends it with an emergency stop. It always begins anew.\n"
      "Exit status 5: the record is not signed, or could not be written: it is then\n"
      "printed as JSON.\n"
      "Example: rheonaut robot commission rheo-1 --data lab");
}

int run(const Commission& options, std::ostream& out) {
  Interruption interruption;
  Person person{answers_of(options), options.says_yes, interruption};
  person.must_answer({"free_ahead_m", "free_behind_m", "direction"});
  check_writable(options.into);
  CommissionRecord record;
  record.robot_id = options.robot_id;
  record.begun_at_us = now_us();
  RobotAccess robot{options.data_dir, options.robot_id, interruption};
  try {
    Commissioning{robot, person, {.largest_duty = options.largest_duty}, record}.run();
  } catch (const Interrupted&) {
    throw std::runtime_error{"interrupted before anything was done to the robot"};
  } catch (const Declined&) {
    throw std::runtime_error{"ended before anything was done to the robot"};
  }
  record.ended_at_us = now_us();
  record.is_confirmed_beforehand = person.says_yes();
  record.prepared = person.prepared();
  sign(record, person);
  record.answers = person.given();
  WrittenRecord written;
  try {
    written = write(record, options.into);
  } catch (const std::exception& error) {
    // What was found is not lost with the disk.
    record.signed_by.clear();
    record.unsigned_because = fmt::format("it could not be written: {}", runtime::text_of(error));
    person.tell("The record could not be written: keep what is printed here.");
    write_json(out, document_of(record));
    return not_done(kNotSigned, "the record is not signed: " + record.unsigned_because);
  }
  std::string not_marked;
  if (!record.signed_by.empty()) {
    not_marked = robot.mark(fmt::format("commissioned ({}), signed by {}, record sha256 {}", outcome_of(record),
                                        record.signed_by, written.sha256));
  }
  if (options.form.is_json) {
    write_json(out, printed_of(record, written, not_marked));
  } else {
    write_as_text(out, record, written, not_marked);
  }
  return record.signed_by.empty() ? not_done(kNotSigned, "the record is not signed: " + record.unsigned_because) : 0;
}

}  // namespace server::cli
