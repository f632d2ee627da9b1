// Recorded values as JSON text: pages of samples, overviews, and missing samples; spelled as openapi.yaml says.
//
// Written without a JSON tree, since it is long. Still takes milliseconds: on a worker, never on the loop.
#pragma once

#include <string>

#include "server/storage/query/history.hpp"

namespace server::api {

std::string page_text(const storage::SegmentPage& page);                                           // SamplePage
std::string overview_text(const storage::Overview& overview, storage::OverviewChannels channels);  // Overview
std::string absences_text(const storage::AbsencePage& page);                                       // GapList

}  // namespace server::api
