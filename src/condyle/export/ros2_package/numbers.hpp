// Numbers of the machine "@name@" and of the scenario. Units: rad or m, N m or N, s.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace @package@ {

@numbers@

}  // namespace @package@
