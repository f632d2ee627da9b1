// Talbot for steps, exponentials for sampled duties.
#include "control/time_response.hpp"
