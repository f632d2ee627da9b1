// What a profile with `until` must fulfil beyond others. Errors: throws std::invalid_argument quoting the bad value.
#pragma once

#include <string>

#include "server/experiments/profile.hpp"

namespace server::experiments {

Until until_from(const std::string& given);  // as text() says it: "sigma(alpha) <= 0.02"

void check_until(const Profile& profile);   // conditions and sweep
void check_choice(const Step& step);        // one of its steps
void check_amount(const Profile& profile);  // of choices, and of what is recorded; with all steps

}  // namespace server::experiments
