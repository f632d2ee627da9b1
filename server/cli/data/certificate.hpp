// `rheonaut certificate`: an authority for one lab, and a certificate of the station that it vouches for.
//
//   DATA/tls/lab-ca.crt, lab-ca.key      the authority: browsers import the first, nobody ever gets the second
//   DATA/tls/station.crt, station.key    what the station shows and proves
#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

#include "server/cli/terminal/output.hpp"

namespace CLI {
class App;
}

namespace server::cli {

struct Certificate {
  std::filesystem::path data_dir = "rheonaut-data";
  std::vector<std::string> names;  // DNS names and IP addresses, beside those of this machine
  bool renew = false;
  bool new_key = false;
  int days = 825;  // of the station's certificate; more is refused by some browsers
  OutputForm form;
};

void add_options(CLI::App& command, Certificate& options);

// Never replaces a certificate without `renew`, nor its key without `new_key`; a running station takes the new one by
// itself. Throws std::runtime_error.
int run(const Certificate& options, std::ostream& out);

}  // namespace server::cli
