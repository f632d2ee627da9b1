// Predicted experiments agree with the reference cases.
#include "control/closed_loop.hpp"

#include <gtest/gtest.h>
