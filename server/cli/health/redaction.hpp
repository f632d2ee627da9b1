// Takes secrets out of text that leaves the machine: those that are known, and what looks like one.
//
// Removed are: known secrets, wherever they stand; PEM blocks; values after "token", "password", "secret", "Bearer",
// "code=" and the like; hosts, users and queries of URLs; words of 20 or more characters that mix letters and digits,
// as tokens, hashes and keys do (names like acceleration_bias_m_s2 stay). Too much is removed rather than too little: a
// digest of a run goes, too. Any text of bytes; no errors.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace server::cli {

class Redaction {
 public:
  // Words shorter than 6 bytes are no secrets: they would stand everywhere.
  void add_secret(std::string secret);

  // Text of anybody: a log, an event.
  std::string of(std::string_view text) const;
  // The program's own sentences, where the word after "token" is no secret.
  std::string of_own(std::string_view text) const;

 private:
  std::vector<std::string> secrets_;
};

}  // namespace server::cli
