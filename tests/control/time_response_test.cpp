// Responses in time agree with the reference, with series and with each other.
#include "control/time_response.hpp"

#include <gtest/gtest.h>
