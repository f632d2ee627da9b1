// The motor is found in its own response.
#include "control/motor_fit.hpp"

#include <gtest/gtest.h>
