// The samples of a run's archive, read from its samples.sqlite.
//
// Blocks; for command-line tools.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/runtime/result.hpp"
#include "server/storage/runs/outside_reference.hpp"
#include "server/storage/runs/run.hpp"
#include "server/storage/samples/stored_sample.hpp"

namespace server::analysis {

struct CapsuleSamples {
  std::vector<storage::StoredSample> samples;  // in order of span and seq
  std::optional<storage::StoredReference> reference;
};

// `file` has the bytes of samples.sqlite: it is read in memory, and nothing of it is left on a disk. invalid: it is not
// an export of a run, or has more samples than that.
Result<CapsuleSamples> read_capsule_samples(std::string& file, std::size_t limit);

}  // namespace server::analysis
