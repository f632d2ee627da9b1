// Writes the tables from the parser's own fields.
#include "sim_robot/scenario/scenario_tables.hpp"

#include "base/field_list.hpp"
#include "sim_robot/scenario/scenario.hpp"

namespace sim_robot {
namespace {

std::string scenario_table() {
  Scenario scenario;
  base::FieldList list;
  fields(list, scenario);
  std::string text = "| key | default | allowed | what it is |\n|---|---|---|---|\n";
  for (const base::Field& field : list.fields) {
    const bool has_own_table = field.key.starts_with("faults[]") || field.key.starts_with("script[]");
    if (!has_own_table) text += base::markdown_row("`" + field.key + "`", field);
  }
  return text;
}

std::string fault_table() {
  std::string text = "| fault | default | allowed | what it is |\n|---|---|---|---|\n";
  for (std::size_t i = 0; i < fault_types().size(); ++i) {
    Fault fault{.kind = static_cast<FaultKind>(i)};
    base::FieldList list;
    fields(list, fault);
    text += list.markdown_rows(fault_types()[i].name, fault_types()[i].what);
  }
  return text;
}

std::string script_table() {
  std::string text = "| command | default | allowed | what it is |\n|---|---|---|---|\n";
  for (std::size_t i = 0; i < script_commands().size(); ++i) {
    ScriptStep step{.command = static_cast<ScriptCommand>(i)};
    base::FieldList list;
    fields(list, step);
    text += list.markdown_rows(script_commands()[i], "");
  }
  return text;
}

}  // namespace

std::string scenario_tables() { return scenario_table() + "\n" + fault_table() + "\n" + script_table(); }

}  // namespace sim_robot
