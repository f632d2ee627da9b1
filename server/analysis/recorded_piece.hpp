// A piece of a run as it was recorded: the samples of a window, where they are missing, and how it can be cut.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/analysis/run_window.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/samples/stored_sample.hpp"

namespace server::analysis {

inline constexpr std::size_t kFewestSamples = 10;
inline constexpr std::size_t kMostFaults = 5;  // in a message
inline constexpr double kTimeToRest_s = 5;

struct Piece {
  std::uint64_t span_began_us = 0;
  std::vector<storage::StoredSample> samples;
  std::optional<double> driven_at_s;  // the last duty before them, if it is not long ago

  double seconds(const storage::StoredSample& stored) const {
    return static_cast<double>(stored.robot_time_us - span_began_us) / 1e6;
  }
  double length_s() const { return seconds(samples.back()) - seconds(samples.front()); }
};

// The samples of the window. invalid: there are too few, or several spans to choose from.
Result<Piece> select(std::span<const storage::StoredSample> samples, const RunWindow& window);

// The middle one of the steps between samples that follow each other: what gaps cannot move.
double usual_step_s(const Piece& piece);

// The tick of each sample.
std::vector<std::size_t> ticks_of(const Piece& piece, double dt_s);

// The longest window from rest of whose ticks few enough are missing; none: each is too short.
std::optional<RunWindow> with_few_missed(const Piece& piece, std::span<const std::size_t> ticks, RunWindow window);

// Where the motion of the piece is had from.
enum class Motion : std::uint8_t { outside, acceleration, position };

// Cuts the piece where it is not whole.
class Cut {
 public:
  Cut(const Piece& piece, const RunWindow& window, double dt_s, Motion motion, double most_skipped);

  bool is_whole() const { return faults_.empty(); }

  // The longest window without a fault that begins at rest, as the model assumes; none: each is too short.
  std::optional<RunWindow> longest(const Piece& piece, RunWindow window) const;

  // Every fault, up to a few, and the longest windows that have none.
  std::unexpected<Error> refusal(const Piece& piece) const;

 private:
  struct Part {
    std::size_t begin = 0, end = 0;
    std::size_t size() const { return end - begin; }
  };

  static bool begins_at_rest(const Piece& piece, const Part& part);
  void end_part(std::size_t end, std::size_t next_begin, std::string why);

  std::size_t begin_ = 0;
  std::vector<Part> parts_;
  std::vector<std::string> faults_;
};

}  // namespace server::analysis
