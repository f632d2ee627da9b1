// `rheonaut fluid`: the fluids of a running station, and the models that are sent to robots in them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <nlohmann/json.hpp>
#include <string>

#include "server/cli/accounts/station_client.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct FluidCommand {
  enum class Act : std::uint8_t { list, model, remove_model };
  Act act = Act::list;
  std::filesystem::path data_dir = "rheonaut-data";
  std::string fluid;
  std::filesystem::path file;   // the model, as `rheonaut estimator --json` writes it; "-": standard input
  std::string confirm_because;  // why a model in grave doubt is the fluid's all the same; empty: it is not said to be
  bool json = false;
};

void add_options(CLI::App& command, FluidCommand& options);

// A model as the API takes it, from a file ("-": standard input). Throws
// std::runtime_error for what is no JSON object.
nlohmann::json model_in_file(const std::filesystem::path& file, const std::string& confirm_because);
// Sends a robot a model (the body of POST …/model), and returns what has become of it, the member `model` of the
// robot's document, after 40 s at most. Throws std::runtime_error saying what the station refused.
nlohmann::json model_sent_to(const AskStation& ask, const std::string& robot_id, const nlohmann::json& body);
// Whether the robot holds the model that was sent, confirmed or assumed, by the member `model` of its document. An
// assumed model has a fit error only if the station has sent it.
bool model_has_arrived(const nlohmann::json& model);
// The path of the API for the model of this fluid, whose name may have any character.
std::string path_of_fluid_model(const std::string& fluid);

// Asks the station that runs in the folder. Throws std::runtime_error saying why nothing was changed.
int run(const FluidCommand& options, std::ostream& out);

}  // namespace server::cli
