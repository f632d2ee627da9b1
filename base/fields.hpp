// Declares the keys of a struct in a file or a request: name with unit, default, range, meaning.
//
// One function per struct calls Fields once for each member. FieldReader then fills the struct from TOML or JSON, and
// FieldList writes their table, so parser, documents and the answers of the fault server cannot differ. A default of
// NaN or an empty text means that the value is required.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace base {

constexpr double kForEver = std::numeric_limits<double>::infinity();
constexpr double kMustBeGiven = std::numeric_limits<double>::quiet_NaN();

struct Range {
  double minimum = -kForEver, maximum = kForEver;  // both allowed

  bool holds(double value) const { return value >= minimum && value <= maximum; }  // false for NaN
};

class Fields {
 public:
  using Inside = std::function<void(Fields&)>;

  virtual ~Fields() = default;

  virtual void number(const char* key, double& value, Range range, const char* what) = 0;
  virtual void whole(const char* key, std::uint64_t& value, Range range, const char* what) = 0;
  virtual void flag(const char* key, bool& value, const char* what) = 0;
  virtual void text(const char* key, std::string& value, const char* what) = 0;
  // One of the names; the index says which. An index beyond them: it must be given.
  virtual void choice(const char* key, std::size_t& index, std::span<const char* const> names, const char* what) = 0;

  // Lists of numbers and of texts, which may be empty; every element within the range, no text empty.
  virtual void numbers(const char* key, std::vector<double>& values, Range range, const char* what) = 0;
  virtual void texts(const char* key, std::vector<std::string>& values, const char* what) = 0;

  // A table and a list of tables with fields of their own; nothing is asked of those that are absent. `inside` is
  // called once for the table, and once for each one of the list.
  virtual void table(const char* key, const char* what, const Inside& inside) = 0;
  virtual void tables(const char* key, const char* what, const Inside& inside) = 0;

  // What the fields before it must fulfil together; std::invalid_argument from it is an error of this table.
  virtual void must(const std::function<void()>& check) = 0;
};

}  // namespace base
