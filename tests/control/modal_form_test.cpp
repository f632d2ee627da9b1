// The sum of exponentials is as accurate as it was asked to be, for any model.
#include "control/modal_form.hpp"

#include <gtest/gtest.h>
