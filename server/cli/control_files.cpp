// Reads whole files, of bounded size.
#include "server/cli/control_files.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "server/analysis/control_json.hpp"
#include "server/cli/options.hpp"

namespace server::cli {
namespace {

constexpr std::size_t kMaxJsonBytes = 1 << 20;
constexpr std::size_t kMaxCsvBytes = 512 << 20;

[[noreturn]] void refuse(const std::string& file, const std::string& why) {
  throw std::runtime_error{fmt::format("{}: {}", file, why)};
}

std::string read_text(const std::string& file, std::size_t max_bytes) {
  if (std::filesystem::is_directory(file)) refuse(file, "is a folder; give a file");
  std::ifstream stream{file, std::ios::binary};
  if (!stream) refuse(file, fmt::format("cannot be read: {}", std::strerror(errno)));
  std::string text;
  for (std::array<char, 65536> block{}; stream.read(block.data(), block.size()) || stream.gcount() > 0;) {
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > max_bytes) refuse(file, fmt::format("has more than {} bytes", max_bytes));
  }
  if (stream.bad()) refuse(file, fmt::format("cannot be read: {}", std::strerror(errno)));
  return text;
}

// nlohmann's messages begin with its own name in brackets and say line and column.
nlohmann::json read_json(const std::string& file) {
  try {
    return nlohmann::json::parse(read_text(file, kMaxJsonBytes));
  } catch (const nlohmann::json::exception& error) {
    const std::string what = error.what();
    const std::size_t bracket = what.find("] ");
    refuse(file, fmt::format("is not JSON: {}", bracket == std::string::npos ? what : what.substr(bracket + 2)));
  }
}

template <class T>
T value_of(const std::string& file, const Result<T>& result) {
  if (!result) refuse(file, result.error().detail);
  return *result;
}

}  // namespace

void add_option(CLI::App& command, PlantChoice& choice) {
  command
      .add_option("--plant", choice.file,
                  "Model file {\"kp\":...,\"b1\":...,\"b2\":...,\"b3\":...,\"alpha\":...,\"beta\":...}, or "
                  "newtonian or non_newtonian (default: non_newtonian, the paper's (29))")
      ->check(named());
}

void add_option(CLI::App& command, ControllerChoice& choice) {
  command
      .add_option("--controller", choice.file,
                  "Controller file {\"kp\":...,\"kd\":...,\"mu\":...} (default: the paper's (30))")
      ->check(named());
}

control::FractionalModel read(const PlantChoice& choice) {
  if (!choice.file || *choice.file == "non_newtonian") return control::kNonNewtonianModel;
  if (*choice.file == "newtonian") return control::kNewtonianModel;
  return value_of(*choice.file, model_from(read_json(*choice.file)));
}

control::FopdController read(const ControllerChoice& choice) {
  if (!choice.file) return control::kPaperController;
  return value_of(*choice.file, controller_from(read_json(*choice.file)));
}

CsvColumns read_csv(const std::string& file, std::initializer_list<const char*> required,
                    std::initializer_list<const char*> optional) {
  return parse_csv(read_text(file, kMaxCsvBytes), file, required, optional);
}

control::Recording read_recording(const std::string& file) {
  CsvColumns columns = read_csv(file, {"duty"}, {"t_s", "robot_time_us", "position_m", "velocity_m_s"});
  const bool has_seconds = columns.contains("t_s");
  if (!has_seconds && !columns.contains("robot_time_us")) refuse(file, "has no column t_s (seconds)");
  if (!columns.contains("position_m") && !columns.contains("velocity_m_s")) {
    refuse(file, "has neither position_m nor velocity_m_s; one of them is needed");
  }
  std::vector<double> time_s = columns[has_seconds ? "t_s" : "robot_time_us"];
  if (!has_seconds) {
    for (double& time : time_s) time *= 1e-6;
  }
  try {
    return control::make_recording(time_s, columns["duty"], columns["position_m"], columns["velocity_m_s"]);
  } catch (const std::invalid_argument& error) {
    refuse(file, error.what());
  }
}

}  // namespace server::cli
