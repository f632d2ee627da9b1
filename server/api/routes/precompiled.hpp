// Headers that every file of routes needs, compiled once.
#pragma once

#include <fmt/format.h>

#include "server/api/routes/routes.hpp"
#include "server/runtime/precompiled.hpp"
