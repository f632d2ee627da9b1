// Checks the archive of a run, and computes its metrics and figures again from the samples in it.
//
// First the SHA-256 of each file and the seal of the archive; where one does not agree nothing is computed. Then each
// number of metrics.json and each plot of report.html is compared with what this program makes of samples.sqlite:
// equal bit for bit, as on the same program and architecture; or within 1e-9, relative; or different.
// Blocks; for command-line tools. Errors: an archive that is no run's is a refusal.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "server/analysis/capsule/archive_reader.hpp"
#include "server/runtime/result.hpp"

namespace server::analysis {

inline constexpr double kReproducedWithin = 1e-9;  // relative

enum class Agreement : std::uint8_t { bit_for_bit, within_tolerance, different };
const char* text(Agreement value);

struct Reproduced {
  std::string name;  // "figures/duty_rms", "plot: Position (m)"
  Agreement agreement = Agreement::different;
  std::string stored, recomputed;  // of a number; "-": there is none
};

struct Reproduction {
  std::string program, architecture;  // that made the archive
  std::size_t files = 0;              // that were checked
  std::vector<std::string> faults;    // a sentence each, which names the file; empty: all is whole
  Seal seal = Seal::none;
  std::vector<Reproduced> results;  // none where there are faults

  bool is_reproduced() const;
};

Result<Reproduction> reproduce(const std::filesystem::path& archive);

// Numbers in two texts, with what stands between them: plots that agree are drawn alike.
Agreement agreement_of(const std::string& stored, const std::string& recomputed);

}  // namespace server::analysis
