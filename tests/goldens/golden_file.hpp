// The comparison with a file of tests/data/goldens, and how such a file is renewed.
//
//   expect_golden("stored/runs.txt", answer);
//
// The files are what the program gave when somebody last renewed them on purpose:
//
//   RHEONAUT_RENEW_GOLDENS=1 build/dev/bin/goldens_test
#pragma once

#include <filesystem>
#include <string>

namespace server {

std::filesystem::path golden_path(const std::string& name);

// Fails the test where `now` is not the file byte for byte, with the first difference; when renewing, writes the file.
void expect_golden(const std::string& name, const std::string& now);

}  // namespace server
