// The closed form, its condition, and what to offer instead.
#include "control/tune.hpp"
