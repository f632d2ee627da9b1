// What the doctor checks of the data folder: who owns it and may read its secrets, and the certificate.
//
// Errors: none; what cannot be read is a finding.
#pragma once

#include <cstdint>
#include <filesystem>

#include "server/cli/health/findings.hpp"
#include "server/config/config.hpp"

namespace server::cli {

void check_permissions(const config::Config& config, Findings& findings);
void check_certificate(const config::Config& config, std::int64_t now_us, Findings& findings);  // UTC

}  // namespace server::cli
