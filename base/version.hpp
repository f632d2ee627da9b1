// The version of both programs, as CMakeLists.txt has it.
#pragma once

namespace base {

// "0.9.0"; never null.
const char* version();

}  // namespace base
