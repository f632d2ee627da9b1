// Random bytes that are the same in every run: ids, salts and secrets of a station in a test.
#pragma once

namespace server {

// libsodium takes its bytes from here, from the beginning again; before the first station of a test.
void fix_random_bytes();

}  // namespace server
