// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>

#include <cstdio>
#include <memory>
#include <string>

namespace emit::test {

/// An authority that signs certificates for a test, all on elliptic-curve keys; files are PEM.
class Authority {
 public:
  explicit Authority(const std::string& name)
      : key_(EVP_EC_gen("P-256")),
        certificate_(make(name, key_.get(), true, {}, nullptr, nullptr)) {}

  void write(const std::string& file) const { write_certificate(certificate_.get(), file); }

  /// Issues a certificate. `alternatives` is its subjectAltName, such as "DNS:rig,IP:127.0.0.1".
  void issue(const std::string& name, const std::string& alternatives,
             const std::string& certificate_file, const std::string& key_file) const {
    const Key key(EVP_EC_gen("P-256"));
    const Certificate made =
        make(name, key.get(), false, alternatives, certificate_.get(), key_.get());
    write_certificate(made.get(), certificate_file);
    std::FILE* out = std::fopen(key_file.c_str(), "w");
    ASSERT_NE(out, nullptr);
    PEM_write_PrivateKey(out, key.get(), nullptr, nullptr, 0, nullptr, nullptr);
    std::fclose(out);
    ::chmod(key_file.c_str(), 0600);
  }

 private:
  struct Free {
    void operator()(EVP_PKEY* key) const noexcept { EVP_PKEY_free(key); }
    void operator()(X509* certificate) const noexcept { X509_free(certificate); }
  };
  using Key = std::unique_ptr<EVP_PKEY, Free>;
  using Certificate = std::unique_ptr<X509, Free>;

  static void add_extension(X509* certificate, X509* issuer, int id, const std::string& value) {
    X509V3_CTX context;
    X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
    X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, &context, id, value.c_str());
    ASSERT_NE(extension, nullptr) << value;
    X509_add_ext(certificate, extension, -1);
    X509_EXTENSION_free(extension);
  }

  static Certificate make(const std::string& name, EVP_PKEY* key, bool authority,
                          const std::string& alternatives, X509* issuer, EVP_PKEY* issuer_key) {
    Certificate out(X509_new());
    static long serial = 0;
    X509_set_version(out.get(), 2);
    ASN1_INTEGER_set(X509_get_serialNumber(out.get()), ++serial);
    constexpr long kHourS = 3600;
    X509_gmtime_adj(X509_getm_notBefore(out.get()), -kHourS);
    X509_gmtime_adj(X509_getm_notAfter(out.get()), kHourS);
    X509_set_pubkey(out.get(), key);
    X509_NAME_add_entry_by_txt(X509_get_subject_name(out.get()), "CN", MBSTRING_ASC,
                               reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
    X509* const signer = issuer != nullptr ? issuer : out.get();
    X509_set_issuer_name(out.get(), X509_get_subject_name(signer));
    add_extension(out.get(), signer, NID_basic_constraints,
                  authority ? "critical,CA:TRUE" : "critical,CA:FALSE");
    if (!alternatives.empty()) {
      add_extension(out.get(), signer, NID_subject_alt_name, alternatives);
    }
    EXPECT_GT(X509_sign(out.get(), issuer_key != nullptr ? issuer_key : key, EVP_sha256()), 0);
    return out;
  }

  static void write_certificate(X509* certificate, const std::string& file) {
    std::FILE* out = std::fopen(file.c_str(), "w");
    ASSERT_NE(out, nullptr);
    PEM_write_X509(out, certificate);
    std::fclose(out);
  }

  Key key_;
  Certificate certificate_;
};

}  // namespace emit::test
