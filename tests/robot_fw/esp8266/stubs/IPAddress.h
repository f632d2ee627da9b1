// Stub of an address: nothing looks into it.
#pragma once

class IPAddress {};
