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

  bool must_be_given() const;
  // For people: "0 to 10", "0 or more", "true or false".
  std::string allowed() const;
  std::string value_text() const;
};

// "5", "0.000817", "for ever".
std::string number_text(double value);
std::string range_text(Range range);

class FieldList final : public Fields {
 public:
  void number(const char* key, double& value, Range range, const char* what) override;
  void whole(const char* key, std::uint64_t& value, Range range, const char* what) override;
  void flag(const char* key, bool& value, const char* what) override;
  void text(const char* key, std::string& value, const char* what) override;
  void choice(const char* key, std::size_t& index, std::span<const char* const> names, const char* what) override;
  void table(const char* key, const char* what, const Inside& inside) override;
  void tables(const char* key, const char* what, const Inside& inside) override;
  void must(const std::function<void()>& check) override;

  std::vector<Field> fields;

 private:
  void within(const std::string& prefix, const Inside& inside);

  std::string prefix_;
};

}  // namespace base
