// The report of a run: what stands in it, that nothing of it can act, and how a long line becomes a short path.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>

#include "server/analysis/metrics/metrics_json.hpp"
#include "server/analysis/report/run_report.hpp"
#include "server/analysis/report/svg_plot.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

std::size_t count_of(const std::string& text, const std::string& wanted) {
  std::size_t count = 0;
  for (std::size_t at = text.find(wanted); at != std::string::npos; at = text.find(wanted, at + 1)) ++count;
  return count;
}

analysis::TracePoint trace_at(std::uint64_t seq) {
  analysis::TracePoint point;
  point.seq = seq;
  point.robot_time_us = 5'000'000 + seq * 10'000;
  point.utc_us = 1'750'000'000'000'000 + static_cast<std::int64_t>(seq) * 10'000;
  point.position_m = 0.001F * static_cast<float>(seq);
  point.position_sd_m = 0.002F;
  point.setpoint_m = std::nanf("");
  return point;
}

analysis::RunReport report_of(std::vector<analysis::TracePoint> trace) {
  analysis::RunReport report;
  report.run.conditions.name = "first";
  report.trace = std::move(trace);
  report.metrics = analysis::json_of(analysis::RunMetrics{{{"gaps", 0.0}}, {}});
  return report;
}

TEST(RunReport, EscapesWhatPeopleAndRobotsWrote) {
  const std::string hostile = "<script>alert('1' & \"2\")</script>";
  analysis::RunReport report = report_of({trace_at(0), trace_at(1)});
  storage::RunConditions& said = report.run.conditions;
  for (std::string* text :
       {&said.name, &said.fluid, &said.pump_profile, &said.tube, &said.operator_name, &said.profile, &said.notes,
        &said.verdict, &report.run.robot_id, &report.run.firmware_version, &report.sha256, &report.program}) {
    *text = hostile;
  }
  storage::AuditEntry entry;
  entry.note.by.actor = entry.note.action = hostile;
  report.audit.push_back(entry);
  report.designs.push_back({1, "model", hostile, hostile});
  const std::string html = analysis::html_of(report);
  EXPECT_THAT(html, AllOf(Not(HasSubstr("<script")), Not(HasSubstr("('1'")), HasSubstr("&lt;script&gt;")));
  EXPECT_GE(count_of(html, "&lt;script&gt;alert(&#39;1&#39; &amp; &quot;2&quot;)"), 16U);
}

TEST(RunReport, LoadsNothing) {
  const std::string html = analysis::html_of(report_of({trace_at(0), trace_at(1)}));
  EXPECT_THAT(html, AllOf(Not(HasSubstr("http:")), Not(HasSubstr("https:")), Not(HasSubstr("src=\"")),
                          Not(HasSubstr("href")), Not(HasSubstr("url("))));
  EXPECT_EQ(count_of(html, "<svg"), 3U);
  EXPECT_EQ(count_of(html, "<svg"), count_of(html, "</svg>"));
}

TEST(RunReport, OfARunWithoutSamplesSaysSo) {
  EXPECT_THAT(analysis::html_of(report_of({})), HasSubstr("No sample of this run is stored."));
}

TEST(RunReport, AnEstimateHasABandAndAKnownPositionHasNone) {
  EXPECT_THAT(analysis::html_of(report_of({trace_at(0), trace_at(1)})),
              AllOf(HasSubstr("± 2 sd</text>"), HasSubstr("the robot&#39;s estimate</text>")));
  analysis::TracePoint known = trace_at(0);
  known.position_sd_m = 0;
  EXPECT_THAT(analysis::html_of(report_of({known})), Not(HasSubstr("± 2 sd</text>")));
}

TEST(RunReport, ALineIsInterruptedWhereSamplesAreMissing) {
  const std::string whole = analysis::html_of(report_of({trace_at(0), trace_at(1), trace_at(2)}));
  const std::string broken = analysis::html_of(report_of({trace_at(0), trace_at(1), trace_at(5)}));
  EXPECT_EQ(count_of(whole, "d=\"M62.5"), count_of(broken, "d=\"M62.5"));
  analysis::Plot plot;
  plot.x_to = 10;
  plot.lines.push_back({"x", "#000", {0, 4, 5, 10}, {1, 2, std::nan(""), 3}});
  const std::string svg = analysis::svg_of(plot);
  const std::string path = svg.substr(svg.rfind("<path"));
  EXPECT_EQ(count_of(path, "M"), 2U) << path;
}

TEST(RunReport, TimesGoOnOverAReboot) {
  analysis::TracePoint after = trace_at(0);
  after.span = 1;
  after.robot_time_us = 40'000;
  after.utc_us += 7'000'000;
  analysis::TracePoint next = after;
  next.seq = 1;
  next.robot_time_us += 10'000;
  const std::vector<analysis::TracePoint> points{trace_at(0), trace_at(1), after, next};
  const auto times_s = analysis::times_of(points);
  EXPECT_NEAR(times_s[1], 0.01, 1e-9);
  EXPECT_NEAR(times_s[2], 7, 1e-9);
  EXPECT_NEAR(times_s[3], 7.01, 1e-9);
  EXPECT_FALSE(analysis::follows(points[1], points[2]));
}

TEST(SvgPlot, ALongLineHasFourPointsAColumnAndLosesNoPeak) {
  analysis::Plot plot;
  plot.x_to = 1000;
  analysis::PlotLine line;
  for (int k = 0; k < 100'000; ++k) {
    line.x.push_back(0.01 * k);
    line.value.push_back(k == 54'321 ? 10 : std::sin(0.1 * k));
  }
  plot.lines.push_back(line);
  const std::string svg = analysis::svg_of(plot);
  EXPECT_LT(svg.size(), 60'000U);
  double highest_px = 1000;
  const std::string path = svg.substr(svg.rfind("<path"));
  for (std::size_t at = path.find('L'); at != std::string::npos; at = path.find('L', at + 1)) {
    highest_px = std::min(highest_px, std::stod(path.substr(path.find(' ', at) + 1)));
  }
  EXPECT_LT(highest_px, 40) << "the one sample of 10 is the top of the plot";
}

TEST(SvgPlot, ALegendThatDoesNotFitBesideTheTitleHasRowsOfItsOwn) {
  analysis::Plot plot;
  plot.title = "Position (m)";
  plot.lines.push_back({"run 1", "var(--run-1)", {0, 1}, {1, 2}});
  EXPECT_THAT(analysis::svg_of(plot), HasSubstr("viewBox=\"0 0 760 190\""));
  for (int run = 2; run <= 12; ++run)
    plot.lines.push_back({fmt::format("run {}", run), "var(--run-2)", {0, 1}, {1, 2}});
  const std::string svg = analysis::svg_of(plot);
  EXPECT_THAT(svg, HasSubstr("viewBox=\"0 0 760 222\"")) << "two rows of 16 pixels";
  EXPECT_EQ(count_of(svg, ">run "), 12U);
}

TEST(SvgPlot, TicksAreRoundAndWithinTheRange) {
  EXPECT_THAT(analysis::ticks_between(0, 1, 5),
              ElementsAre(0, 0.2, ::testing::DoubleNear(0.4, 1e-12), ::testing::DoubleNear(0.6, 1e-12), 0.8, 1));
  EXPECT_THAT(analysis::ticks_between(-7, 12, 4), ElementsAre(-5, 0, 5, 10));
  EXPECT_TRUE(analysis::ticks_between(1, 1, 4).empty());
  EXPECT_TRUE(analysis::ticks_between(std::nan(""), 1, 4).empty());
}

class ReportRouteTest : public ApiTest {};

TEST_F(ReportRouteTest, GivesTheRunAsAFile) {
  connect_robot();
  ASSERT_EQ(ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "a <b> run"}}).status, 201);
  make_samples(*robot, 0, 25);
  clock.run_for(1s);
  ASSERT_EQ(ask("POST", "/api/v1/runs/1/end").status, 200);
  clock.run_for(5s);
  const Answered report = ask("GET", "/api/v1/runs/1/report.html");
  ASSERT_EQ(report.status, 200) << report.body;
  const json certificate = ask("GET", "/api/v1/runs/1/certificate").parsed();
  EXPECT_THAT(report.body, AllOf(HasSubstr("<h1>a &lt;b&gt; run</h1>"), HasSubstr("run.made"),
                                 HasSubstr(certificate["sha256"].get<std::string>())));
  EXPECT_EQ(ask("GET", "/api/v1/runs/2/report.html").status, 404);
  EXPECT_THAT(report.body, Not(HasSubstr("Models and controllers")));
}

TEST_F(ReportRouteTest, NamesTheModelsFoundFromTheRunWithWhatIsInDoubtAboutThem) {
  connect_robot();
  ASSERT_EQ(ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "first"}}).status, 201);
  make_samples(*robot, 0, 25);
  const json doubt{{"code", "search_not_converged"}, {"value", 9}, {"widening", nullptr}};
  const json model{{"kp", 0.1}, {"b1", 0.006}, {"b2", 0.1}, {"alpha", 1.8}, {"beta", 0.9}};
  for (const json& doubts : {json::array({doubt}), json::array()}) {
    const json body{{"kind", "model"},
                    {"name", doubts.empty() ? "sound" : "<doubtful>"},
                    {"document", {{"parameters", model}, {"doubts", doubts}, {"widening", nullptr}}},
                    {"runs", {{{"run_id", 1}}}}};
    const Answered stored = ask("POST", "/api/v1/designs", body);
    ASSERT_EQ(stored.status, 201) << stored.body;
  }
  clock.run_for(1s);
  ASSERT_EQ(ask("POST", "/api/v1/runs/1/end").status, 200);
  clock.run_for(5s);
  const std::string report = ask("GET", "/api/v1/runs/1/report.html").body;
  EXPECT_THAT(report, AllOf(HasSubstr("<h2>Models and controllers from this run</h2>"),
                            HasSubstr("<td>2</td><td>model</td><td>sound</td><td></td>"),
                            HasSubstr("<td>&lt;doubtful&gt;</td><td>in doubt: the search did not converge")));
}

}  // namespace
}  // namespace server
