// Certificates and signatures of a graph's own authorities: P-256, ECDSA with SHA-256.
#pragma once

#include <string>

#include "graph/security.hpp"

namespace cosegraph::keys {

// PEM texts. `key` is a secret: it goes to a file of mode 0600 and nowhere else.
struct Credential {
  std::string certificate;
  std::string key;
};

// An authority that is trusted because its certificate is known. Names of more than 64 characters
// do not fit a certificate: InputError, here and below.
Credential make_authority(const graph::Subject& subject, const graph::Validity& validity);

// A new key with a certificate by `authority`. Throws InputError if that cannot be read.
Credential issue(const Credential& authority, const graph::Subject& subject,
                 const graph::Validity& validity);

// The text with the authority's signature, in the form of signed mail (S/MIME).
std::string sign(const Credential& authority, const std::string& text);

}  // namespace cosegraph::keys
