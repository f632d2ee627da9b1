// How far the robot coasts once the motor is off: the table of docs/robot.md, computed again.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "control/models/modal_plant.hpp"

namespace control {
namespace {

constexpr double kStepS = 0.01;

void run(ModalPlant& plant, double duty, double time_s) {
  for (long i = std::lround(time_s / kStepS); i > 0; --i) plant.step(duty);
}

struct Coast {
  double speed_m_s = 0;                    // when the motor goes off
  double after_mm[3] = {};                 // 1 s, 10 s, 60 s later
  double late_by_50_ms_mm = 0;             // from the order to stop, which takes effect 50 ms later, to 60 s after it
  double late_by_the_link_timeout_mm = 0;  // the same with 1 s
};

double stopping_distance_mm(const FractionalModel& model, double duty, double driven_s, double late_s) {
  ModalPlant plant{model, kStepS};
  run(plant, duty, driven_s);
  const double ordered_at_m = plant.position_m();
  run(plant, duty, late_s);
  run(plant, 0, 60);
  return 1000 * (plant.position_m() - ordered_at_m);
}

Coast coast(const FractionalModel& model, double duty, double driven_s) {
  ModalPlant plant{model, kStepS};
  run(plant, duty, driven_s);
  Coast coast;
  coast.speed_m_s = plant.velocity_m_s();
  const double off_at_m = plant.position_m();
  const double pieces_s[] = {1, 9, 50};
  for (std::size_t i = 0; i < 3; ++i) {
    run(plant, 0, pieces_s[i]);
    coast.after_mm[i] = 1000 * (plant.position_m() - off_at_m);
  }
  coast.late_by_50_ms_mm = stopping_distance_mm(model, duty, driven_s, 0.05);
  coast.late_by_the_link_timeout_mm = stopping_distance_mm(model, duty, driven_s, 1);
  return coast;
}

using Row = std::vector<std::string>;

// The rows of the table under the heading, without its head.
std::vector<Row> documented_rows() {
  std::ifstream document{ROBOT_DOCUMENT};
  std::vector<Row> rows;
  bool here = false;
  for (std::string line; std::getline(document, line);) {
    if (line.starts_with("## ")) here = line == "## Coasting";
    if (!here || !line.starts_with("| ")) continue;
    Row row;
    std::istringstream cells{line.substr(2)};
    for (std::string cell; std::getline(cells, cell, '|');)
      row.push_back(cell.substr(0, cell.find_last_not_of(' ') + 1));
    for (std::string& cell : row) cell.erase(0, cell.find_first_not_of(' '));
    rows.push_back(row);
  }
  if (!rows.empty()) rows.erase(rows.begin());
  return rows;
}

// Half a unit of the last digit that is printed.
double rounding_of(const std::string& number) {
  const auto point = number.find('.');
  const auto decimals = point == std::string::npos ? 0 : number.size() - point - 1;
  return 0.5001 * std::pow(10.0, -static_cast<double>(decimals));
}

TEST(CoastDistance, IsWhatTheDocumentSays) {
  const auto rows = documented_rows();
  ASSERT_EQ(rows.size(), 9U);
  for (const Row& row : rows) {
    ASSERT_EQ(row.size(), 9U);
    const FractionalModel& model = row[0] == "water" ? kNewtonianModel : kNonNewtonianModel;
    const double driven_s = std::stod(row[1]), duty = std::stod(row[2]);
    const Coast found = coast(model, duty, driven_s);
    const double values[] = {found.speed_m_s,   found.after_mm[0],      found.after_mm[1],
                             found.after_mm[2], found.late_by_50_ms_mm, found.late_by_the_link_timeout_mm};
    for (std::size_t i = 0; i < std::size(values); ++i) {
      EXPECT_NEAR(std::stod(row[i + 3]), values[i], rounding_of(row[i + 3])) << row[0] << ' ' << row[1] << " s, " << i;
    }
  }
}

// The fluid remembers: it carries on longer what was driven longer. Water forgets within half a second.
TEST(CoastDistance, DependsOnTheDriveBeforeItOnlyInTheFluid) {
  const auto ratio = [](const FractionalModel& model) {
    const Coast push = coast(model, 0.3, 1), drive = coast(model, 0.3, 60);
    return drive.after_mm[2] / drive.speed_m_s / (push.after_mm[2] / push.speed_m_s);
  };
  EXPECT_NEAR(ratio(kNonNewtonianModel), 1.55, 0.01);
  EXPECT_NEAR(ratio(kNewtonianModel), 1, 1e-3);
}

}  // namespace
}  // namespace control
