// Steps plant and controller together.
#include "control/closed_loop.hpp"
