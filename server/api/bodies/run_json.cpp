// Member by member.
#include "server/api/bodies/run_json.hpp"

namespace server::api {
using nlohmann::json;

json to_json(const storage::CurrentDigest& found, storage::RunId run) {
  const storage::RunDigest& digest = found.digest;
  json out;
  out["run_id"] = run;
  out["final"] = found.is_final;
  out["format"] = digest.format;
  out["samples_expected"] = digest.samples_expected;
  out["samples_live"] = digest.samples_live;
  out["samples_backfilled"] = digest.samples_backfilled;
  out["samples_lost"] = digest.samples_lost;
  out["samples_missing"] = digest.samples_missing();
  out["lost_by_cause"] = digest.lost_by_cause;
  out["longest_gap_samples"] = digest.longest_gap_samples;
  out["longest_gap_us"] = digest.longest_gap_us;
  out["missed_ticks"] = digest.missed ? json(digest.missed->count) : json(nullptr);
  out["longest_missed_ticks"] = digest.missed ? json(digest.missed->longest) : json(nullptr);
  out["worst_clock_uncertainty_us"] = digest.worst_clock_uncertainty_us;
  out["samples_without_clock"] = digest.samples_without_clock;
  out["sha256"] = found.is_final ? json(digest.sha256) : json(nullptr);
  out["made_at_us"] = digest.made_at_us;
  return out;
}

json to_json(const storage::RunSnapshot& snapshot) {
  json in_force = json::array();
  for (const storage::InForce& document : snapshot.in_force) {
    in_force.push_back({{"kind", document.kind},
                        {"span", document.span},
                        {"first_seq", document.first_seq},
                        {"content", json::parse(document.content, nullptr, false)}});
  }
  json out;
  out["firmware_version"] = snapshot.firmware_version;
  out["controller_id"] = snapshot.controller_id;
  out["controller_checksum"] = snapshot.controller_checksum;
  out["parameters_checksum"] = snapshot.parameters_checksum;
  out["in_force"] = std::move(in_force);
  return out;
}

}  // namespace server::api
