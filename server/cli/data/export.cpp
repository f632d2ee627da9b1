// Writes beside the wanted file, and gives it its name when it is whole and on disk.
#include "server/cli/data/export.hpp"

#include <fmt/format.h>
#include <ostream>
#include <stdexcept>

#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/progress.hpp"
#include "server/storage/database/finished_file.hpp"
#include "server/storage/export/export_child.hpp"

namespace server::cli {
namespace {

constexpr std::int64_t kLargestRun = std::numeric_limits<std::int64_t>::max();
constexpr long long kMinGridUs = 100;
constexpr long long kMaxGridUs = 3'600'000'000;

// Removed unless keep() was called.
class PartFile {
 public:
  explicit PartFile(const std::filesystem::path& wanted) : wanted_{wanted}, path_{wanted.string() + ".part"} {
    clear();
  }
  ~PartFile() { clear(); }
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  void keep() { storage::finish_file(path_, wanted_); }

 private:
  void clear() const {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }

  std::filesystem::path wanted_;
  std::filesystem::path path_;
};

void write(const storage::ExportOrder& order, const OutputForm& form) {
  Progress progress{"export", form};
  storage::ExportChild child{order};
  for (Result<bool> more = true; *more;) {
    more = child.advance();
    progress.set_share(child.progress().share());
    if (!more) throw std::runtime_error{more.error().detail};
  }
}

}  // namespace

void add_options(CLI::App& command, Export& options) {
  command.add_option("--run", options.run, "A recorded run by its number")->required()->check(whole(1, kLargestRun));
  add_word(command, "--format", options.format, storage::kExportFormats,
           "csv, mat (MATLAB and Octave), sqlite or mcap (Foxglove)")
      ->required();
  command.add_option("--to", options.to, "The file; one that is there is replaced")->required()->check(named());
  command.add_option("--grid-us", options.grid_us, "csv, mat: rows at equal steps of time, the nearest sample or none")
      ->check(whole(kMinGridUs, kMaxGridUs));
  command
      .add_option("--channels", options.channels, "Names with commas between them, e.g. position_m,duty; default all")
      ->check(named());
  command.add_option("--data", options.data_dir, "Folder of the station that recorded it (default: rheonaut-data)")
      ->check(named());
  add_json_flag(command, options.form);
  command.footer("Example: rheonaut export --run 1 --format mat --to run-1.mat --data ~/lab");
}

int run(const Export& options, std::ostream& out) {
  storage::ExportQuery query{.run = options.run, .channels = storage::all_channels(), .grid_us = options.grid_us};
  if (options.grid_us && !storage::may_have_grid(options.format)) throw UsageError{"--grid-us is for csv and mat"};
  if (!options.channels.empty()) {
    const auto channels = storage::parse_channels(options.channels);
    if (!channels) throw UsageError{"--" + channels.error().detail};
    query.channels = *channels;
  }
  PartFile part{options.to};
  write({options.data_dir / "station.sqlite", options.format, query, part.path()}, options.form);
  part.keep();
  const auto size_bytes = std::filesystem::file_size(options.to);
  if (options.form.is_json) {
    write_json(out, {{"run_id", options.run},
                     {"format", text(options.format)},
                     {"file", options.to.string()},
                     {"size_bytes", size_bytes}});
  } else {
    out << fmt::format("run {}: {} ({} bytes)\n", options.run, options.to.string(), size_bytes);
  }
  return 0;
}

}  // namespace server::cli
