// Frequency responses and margins agree with the reference.
#include "control/margins.hpp"

#include <gtest/gtest.h>
