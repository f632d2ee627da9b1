// Lists the fields of a struct with their values.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "base/fields.hpp"

namespace base {

struct Field {
  std::string key;  // with the tables it is in: vessel.pump.ramp_s, glucose.patches[].length_m
  std::variant<double, std::uint64_t, bool, std::string> value;
  Range range;                     // of numbers
  std::vector<std::string> names;  // of a choice
  std::string what;
  bool is_list = false;  // of numbers in the range, or of texts; its value is the list as text, "none" when it is empty

  bool must_be_given() const;
  // For people: "0 to 10", "0 or more", "true or false".
  std::string allowed() const;
  std::string value_text() const;
};

// "5", "0.000817", "for ever".
std::string number_text(double value);
std::string range_text(Range range);
std::string markdown_row(const std::string& key, const Field& field);

class FieldList final : public Fields {
 public:
  // Rows of a table in Markdown: key, default, allowed, meaning. One for the name and one for each field of it.
  std::string markdown_rows(const std::string& name, const std::string& what) const;

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

  std::vector<Field> fields;

 private:
  void within(const std::string& prefix, const Inside& inside);

  std::string prefix_;
};

}  // namespace base
