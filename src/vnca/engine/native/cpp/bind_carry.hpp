#pragma once

#include <nanobind/nanobind.h>

namespace vnca {

void bind_carry(nanobind::module_& m);

}  // namespace vnca
