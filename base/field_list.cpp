// Collects fields instead of filling them.
#include "base/field_list.hpp"

#include <cmath>

#include "base/invalid_argument.hpp"

namespace base {

std::string number_text(double value) {
  return std::isinf(value) ? (value > 0 ? "for ever" : "since ever") : join_text(value);
}

std::string range_text(Range range) {
  if (std::isinf(range.minimum) && std::isinf(range.maximum)) return "any number";
  if (std::isinf(range.maximum)) return join_text(range.minimum, " or more");
  return join_text(range.minimum, " to ", range.maximum);
}

bool Field::must_be_given() const {
  if (const double* number = std::get_if<double>(&value)) return std::isnan(*number);
  if (const std::string* text = std::get_if<std::string>(&value)) return text->empty();
  return false;
}

std::string Field::allowed() const {
  if (is_list) return "a list of " + (names.empty() ? "numbers, " + range_text(range) : names.front());
  if (!names.empty()) {
    std::string list;
    for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
    return list;
  }
  if (std::holds_alternative<bool>(value)) return "true or false";
  if (std::holds_alternative<std::string>(value)) return "text";
  return range_text(range);
}

std::string Field::value_text() const {
  if (must_be_given()) return "";
  if (const double* number = std::get_if<double>(&value)) return number_text(*number);
  if (const std::uint64_t* number = std::get_if<std::uint64_t>(&value)) return std::to_string(*number);
  if (const bool* flag = std::get_if<bool>(&value)) return *flag ? "true" : "false";
  return std::get<std::string>(value);
}

std::string markdown_row(const std::string& key, const Field& field) {
  const std::string value = field.must_be_given() ? "must be given" : field.value_text();
  return "| " + key + " | " + value + " | " + field.allowed() + " | " + field.what + " |\n";
}

std::string FieldList::markdown_rows(const std::string& name, const std::string& what) const {
  std::string text = "| `" + name + "` | | | " + what + " |\n";
  for (const Field& field : fields) text += markdown_row("· `" + field.key + "`", field);
  return text;
}

void FieldList::number(const char* key, double& value, Range range, const char* what) {
  fields.push_back({prefix_ + key, value, range, {}, what});
}

void FieldList::whole(const char* key, std::uint64_t& value, Range range, const char* what) {
  fields.push_back({prefix_ + key, value, range, {}, what});
}

void FieldList::flag(const char* key, bool& value, const char* what) {
  fields.push_back({prefix_ + key, value, {}, {}, what});
}

void FieldList::text(const char* key, std::string& value, const char* what) {
  fields.push_back({prefix_ + key, value, {}, {}, what});
}

void FieldList::choice(const char* key, std::size_t& index, std::span<const char* const> names, const char* what) {
  const std::string value = index < names.size() ? names[index] : "";
  fields.push_back({prefix_ + key, value, {}, {names.begin(), names.end()}, what});
}

void FieldList::numbers(const char* key, std::vector<double>& values, Range range, const char* what) {
  std::string all;
  for (const double value : values) all += (all.empty() ? "" : ", ") + number_text(value);
  fields.push_back({prefix_ + key, all.empty() ? "none" : all, range, {}, what, true});
}

void FieldList::texts(const char* key, std::vector<std::string>& values, const char* what) {
  std::string all;
  for (const std::string& value : values) all += (all.empty() ? "" : ", ") + value;
  fields.push_back({prefix_ + key, all.empty() ? "none" : all, {}, {"texts"}, what, true});
}

void FieldList::table(const char* key, const char*, const Inside& inside) { within(prefix_ + key + ".", inside); }

void FieldList::tables(const char* key, const char*, const Inside& inside) { within(prefix_ + key + "[].", inside); }

void FieldList::within(const std::string& prefix, const Inside& inside) {
  const std::string outside = prefix_;
  prefix_ = prefix;
  inside(*this);
  prefix_ = outside;
}

void FieldList::must(const std::function<void()>&) {}

}  // namespace base
