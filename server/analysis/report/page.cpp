// The style, once.
#include "server/analysis/report/page.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>
#include <ctime>

#include "server/analysis/report/svg_plot.hpp"

namespace server::analysis {
namespace {

constexpr const char* kBeforeTitle = R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width">
<meta name="color-scheme" content="light dark">
<title>)";

constexpr const char* kAfterTitle = R"(</title>
<style>
:root { --ink: #1b2a33; --quiet: #5b6b73; --rule: #e3e9eb; --edge: #8b9aa1; --paper: #fff; --mark: #fff3d6;
  --measured: #1b2a33; --commanded: #b0186f; --outside: #12805c;
  --run-1: #0b5cad; --run-2: #c8500a; --run-3: #12805c; --run-4: #b0186f; --run-5: #8a6d00; --run-6: #3b9bd6;
  --run-7: #6b4ba3; --run-8: #4d5a60; --run-9: #a33a3a; --run-10: #2f8f8f; --run-11: #6f8416; --run-12: #b3729f }
@media screen and (prefers-color-scheme: dark) { :root { --ink: #e4ecef; --quiet: #9fb0b8; --rule: #2b383f;
  --edge: #5f717a; --paper: #131b20; --mark: #4a3c14; --measured: #e4ecef; --commanded: #ff7ac0; --outside: #4fd0a0;
  --run-1: #6db3ff; --run-2: #ff9a5c; --run-3: #4fd0a0; --run-4: #ff7ac0; --run-5: #e0c04a; --run-6: #8fd3ff;
  --run-7: #b79cf0; --run-8: #b6c3c9; --run-9: #f08c8c; --run-10: #6fd6d6; --run-11: #b9d15a; --run-12: #e6b3d6 } }
body { font: 14px/1.45 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 800px; margin: 24px auto; padding: 0 20px }
h1 { font-size: 24px; line-height: 1.25; margin: 0 0 4px }
h2 { font-size: 16px; margin: 28px 0 8px; border-bottom: 1px solid var(--edge); padding-bottom: 3px }
h3 { font-size: 14px; margin: 16px 0 4px }
p { margin: 6px 0 }
ul { margin: 6px 0; padding-left: 20px }
.quiet { color: var(--quiet) }
.wide { overflow-x: auto }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums }
th, td { text-align: left; padding: 3px 10px 3px 0; vertical-align: top; border-bottom: 1px solid var(--rule) }
th { font-weight: 600 }
td.number, th.number { text-align: right; white-space: nowrap }
td.differs { background: var(--mark); padding-left: 6px }
th.differs::before { content: "≠ " }
.swatch { display: inline-block; width: 18px; height: 3px; vertical-align: middle; border-radius: 2px }
.pairs { columns: 2; column-gap: 32px }
.pairs div { display: flex; justify-content: space-between; gap: 12px; border-bottom: 1px solid var(--rule); padding: 3px 0; break-inside: avoid }
.pairs span:last-child { text-align: right; overflow-wrap: anywhere }
svg { display: block; width: 100%; margin: 6px 0 2px; break-inside: avoid }
svg text { font: 11px system-ui, sans-serif; fill: var(--quiet) }
svg text.title { font-weight: 600; fill: var(--ink) }
svg .grid { stroke: var(--rule); fill: none }
svg .frame { stroke: var(--edge); fill: none }
code { font: 12px ui-monospace, monospace; overflow-wrap: anywhere }
@media print { @page { margin: 16mm 14mm } body { margin: 0; padding: 0; max-width: none; font-size: 12px } h2, h3 { break-after: avoid }
  tr { break-inside: avoid } .wide { overflow: visible } .wide table { font-size: 11px }
  td, th, .swatch, svg { print-color-adjust: exact; -webkit-print-color-adjust: exact } }
</style></head><body>
)";

}  // namespace

std::string page_head(const std::string& title) { return kBeforeTitle + html_escaped(title) + kAfterTitle; }

std::string page_end() { return "</body></html>\n"; }

std::string utc_text(std::int64_t at_us) {
  return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(static_cast<std::time_t>(at_us / 1'000'000)));
}

std::string number_text(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}g}", value, digits) : "–";
}

std::string number_text(const nlohmann::json& value, int digits) {
  return value.is_number() ? number_text(value.get<double>(), digits) : "–";
}

std::string pairs_of(const std::vector<std::pair<std::string, std::string>>& rows) {
  std::string out = "<div class=\"pairs\">";
  for (const auto& [name, value] : rows) {
    if (value.empty()) continue;
    out += fmt::format("<div><span>{}</span><span>{}</span></div>", html_escaped(name), html_escaped(value));
  }
  return out + "</div>\n";
}

std::string made_by(std::int64_t made_at_us, const std::string& program) {
  return fmt::format("<p class=\"quiet\">Made {} by Rheonaut {}.</p>\n", utc_text(made_at_us), html_escaped(program));
}

}  // namespace server::analysis
