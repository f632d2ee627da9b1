// Fills a struct from a TOML table and refuses what is not in the struct.
//
// Errors: std::invalid_argument, `file:line:column: key: what is wrong, the value, what is allowed`. The place is left
// out when the table was not read from text (for example, made from JSON).
#pragma once

#include <toml++/toml.h>

#include <string>
#include <vector>

#include "base/fields.hpp"

namespace base {

class FieldReader final : public Fields {
 public:
  // `origin` is what errors call the text; both must outlive the reader. `path`: of the table, "" or ending in a dot.
  FieldReader(const toml::table& table, const std::string& origin, std::string path = "");

  void number(const char* key, double& value, Range range, const char* what) override;
  void whole(const char* key, std::uint64_t& value, Range range, const char* what) override;
  void flag(const char* key, bool& value, const char* what) override;
  void text(const char* key, std::string& value, const char* what) override;
  void choice(const char* key, std::size_t& index, std::span<const char* const> names, const char* what) override;
  void numbers(const char* key, std::vector<double>& values, Range range, const char* what) override;
  void texts(const char* key, std::vector<std::string>& values, const char* what) override;
  void table(const char* key, const char* what, const Inside& inside) override;
  void tables(const char* key, const char* what, const Inside& inside) override;
  void must(const std::function<void()>& check) override;

  // To be called when everything has been asked for: whatever else is in the table is an error.
  void finish() const;

 private:
  std::string meant_for(const std::string& key) const;
  const toml::node* find(const char* key, bool must_be_given, const char* what);
  const toml::array* find_list(const char* key, const char* what, const char* example);  // null: not there
  [[noreturn]] void fail(const toml::source_position& at, const std::string& key, const std::string& why) const;
  [[noreturn]] void fail(const toml::node& node, const std::string& key, const std::string& why) const;
  std::string place(const toml::source_position& at) const;
  void read_table(const toml::node& node, const std::string& key, const Inside& inside) const;

  const toml::table& table_;
  const std::string& origin_;
  std::string path_;
  std::vector<std::string> known_;
};

// One of the names that is nearly the text, or empty when none is.
std::string nearest(const std::string& text, std::span<const std::string> names);
// "; did you mean figure_7?" of the nearest one, or empty.
std::string did_you_mean(const std::string& text, std::span<const std::string> names);
// "a, b, c".
std::string list_of(std::span<const std::string> names);

}  // namespace base
