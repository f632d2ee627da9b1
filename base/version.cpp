// The one source that a change of the version compiles again.
#include "base/version.hpp"

#ifndef RHEONAUT_VERSION
#error "RHEONAUT_VERSION comes from CMake"
#endif

namespace base {

const char* version() { return RHEONAUT_VERSION; }

}  // namespace base
