// The Python side of native decoding.
#pragma once

#include <nanobind/nanobind.h>

namespace vnca {

void bind_decode(nanobind::module_& m);

}  // namespace vnca
