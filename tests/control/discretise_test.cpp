// Discrete controllers agree with the reference fits, and say how well they fit.
#include "control/discretise.hpp"

#include <gtest/gtest.h>
