// Reads the golden frames line by line; the text form is left to decode_golden.py.
#include "golden_file.hpp"

#include <fstream>
#include <sstream>
#include <stdexcept>

namespace protocol {

std::vector<GoldenFrame> read_golden_frames() {
  const std::string path = TEST_DATA_DIR "/golden_frames.txt";
  std::ifstream file{path};
  if (!file) throw std::runtime_error{"cannot open " + path};
  std::vector<GoldenFrame> frames;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words{line};
    std::string key;
    words >> key;
    if (key.empty() || key == "#" || key == "|") continue;
    if (key == "frame") {
      words >> frames.emplace_back().name;
    } else if (key == "from") {
      std::string sender;
      words >> sender;
      frames.back().from_robot = sender == "robot";
    } else if (key == "hex") {
      for (unsigned byte = 0; words >> std::hex >> byte;)
        frames.back().bytes.push_back(static_cast<std::uint8_t>(byte));
    } else {
      throw std::runtime_error{path + ": cannot read the line " + line};
    }
  }
  return frames;
}

}  // namespace protocol
