// Tuned controllers meet what was asked for, or say why none can.
#include "control/tune.hpp"

#include <gtest/gtest.h>
