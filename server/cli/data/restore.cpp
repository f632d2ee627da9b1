// Takes the folder's lock, so that no station starts meanwhile.
#include "server/cli/data/restore.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <stdexcept>

#include "server/cli/accounts/author.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"
#include "server/config/data_folder.hpp"
#include "server/storage/upkeep/restore.hpp"

namespace server::cli {

void add_options(CLI::App& command, Restore& options) {
  command.add_option("--from", options.from, "The backup")->check(named())->required();
  command.add_option("--data", options.data_dir, "Folder of the station; made when missing (default: rheonaut-data)")
      ->check(named());
  add_json_flag(command, options.form);
  command.footer("Example: rheonaut restore --from /mnt/other-disk/lab-monday.sqlite --data ~/lab-restored");
}

int run(const Restore& options, std::ostream& out) {
  config::make_data_folder(options.data_dir);
  const auto lock = config::FolderLock::try_take(options.data_dir);
  if (!lock) {
    throw std::runtime_error{fmt::format("{} uses '{}'; stop it first", config::FolderLock::holder(options.data_dir),
                                         options.data_dir.string())};
  }
  const Progress progress{"restore: the database is copied and verified", options.form};
  const storage::RestoredStore restored =
      storage::restore_database(options.from, options.data_dir, command_line_author());
  const std::filesystem::path database = options.data_dir / "station.sqlite";
  if (options.form.is_json) {
    write_json(out, {{"database", database.string()},
                     {"samples", restored.samples},
                     {"runs", restored.runs},
                     {"runs_interrupted", restored.runs_interrupted},
                     {"verified", true}});
    return 0;
  }
  fmt::print(out, "{}: {} samples and {} runs, verified; {} of the runs were open and are interrupted\n",
             database.string(), restored.samples, restored.runs, restored.runs_interrupted);
  return 0;
}

}  // namespace server::cli
