# Embeds the shipped scenarios in the library sim_robot_scenario.
set(scenario_files bad_day figure_5 figure_7 figure_8_non_newtonian figure_8_water figure_9 figure_a2)
list(TRANSFORM scenario_files PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/../scenarios/)
list(TRANSFORM scenario_files APPEND .toml)
set(shipped_scenarios ${CMAKE_CURRENT_BINARY_DIR}/shipped_scenarios.cpp)
add_custom_command(
  OUTPUT ${shipped_scenarios}
  COMMAND ${PYTHON3} ${CMAKE_CURRENT_SOURCE_DIR}/embed_scenarios.py ${shipped_scenarios} ${scenario_files}
  DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/embed_scenarios.py ${scenario_files}
  COMMENT "Embedding the scenarios")
target_sources(sim_robot_scenario PRIVATE ${shipped_scenarios})
