# Homebrew, for a tap. Untried. ADDRESS and the checksum (SHA256SUMS of `make release`) come with the first release.
# Wheels are taken as they are: Homebrew's own way builds Qt, SciPy and LibRaw from source.
class Kochab < Formula
  desc "Plate solving, polar alignment and telescope mounts"
  homepage "ADDRESS"
  url "ADDRESS/kochab_astro-0.2.0-py3-none-any.whl"
  sha256 "SHA256"
  license "GPL-3.0-or-later"

  depends_on "python@3.13"

  def install
    system Formula["python@3.13"].opt_bin/"python3.13", "-m", "venv", libexec
    wheel = Dir["*.whl"].first
    system libexec/"bin/python", "-m", "pip", "install", "--only-binary=:all:", "#{wheel}[cameras,gamepad]"
    bin.install_symlink libexec/"bin/kochab"
    bin.install_symlink libexec/"bin/kochab-window"
  end

  test do
    assert_match version.to_s, shell_output("#{bin}/kochab --version")
  end
end
