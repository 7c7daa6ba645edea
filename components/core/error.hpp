// The errors that cross a component's border.
//
// Broken input is an exception; an expected "nothing there" is an empty value or an optional. The
// text of an error names what is wrong and where (file, line, field), so that it can be shown to a
// user as it stands.
#pragma once

#include <stdexcept>
#include <string>

namespace cosegraph {

// Base of every error thrown by cosegraph.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Data that cannot be used: a damaged file, an empty cloud, inconsistent sizes.
class InputError : public Error {
 public:
  using Error::Error;
};

// A parameter that is unknown, of the wrong type or out of bounds.
class ParameterError : public Error {
 public:
  using Error::Error;
};

// Data and model were made with different settings, so that a result would be meaningless.
class MismatchError : public Error {
 public:
  using Error::Error;
};

}  // namespace cosegraph
