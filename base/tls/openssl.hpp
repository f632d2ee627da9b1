// OpenSSL's objects with owners, contexts as a Wire needs them, and the texts of OpenSSL's errors.
#pragma once

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <memory>
#include <string>

namespace base {

struct OpensslFree {
  void operator()(BIO* object) const { BIO_free_all(object); }
  void operator()(EVP_PKEY* object) const { EVP_PKEY_free(object); }
  void operator()(X509* object) const { X509_free(object); }
  void operator()(X509_EXTENSION* object) const { X509_EXTENSION_free(object); }
  void operator()(GENERAL_NAMES* object) const { GENERAL_NAMES_free(object); }
  // A session may be resumed though its connection was cut, as radio links are; after a fault OpenSSL has forgotten it.
  void operator()(SSL* object) const {
    SSL_set_shutdown(object, SSL_SENT_SHUTDOWN | SSL_RECEIVED_SHUTDOWN);
    SSL_free(object);
  }
  void operator()(SSL_CTX* object) const { SSL_CTX_free(object); }
  void operator()(SSL_SESSION* object) const { SSL_SESSION_free(object); }
};

template <class T>
using Openssl = std::unique_ptr<T, OpensslFree>;

// A context for connections of a Wire, of TLS_server_method() or TLS_client_method(): TLS 1.2 or newer, writes that may
// be partial, and a cut connection is an end like any other (frames and HTTP messages say themselves how long they
// are), so its session may be resumed. Throws std::runtime_error.
Openssl<SSL_CTX> make_tls_context(const SSL_METHOD* side);

// The latest error of this thread in OpenSSL's words, which is taken from its queue; `otherwise` when there is none.
std::string openssl_error(const char* otherwise);

}  // namespace base
