#pragma once

#include <nanobind/nanobind.h>

namespace vnca {

void bind_march(nanobind::module_& m);

}  // namespace vnca
