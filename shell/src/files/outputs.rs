//! Check that no output takes the place of an input.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Error of an output that would destroy an input or another output.
#[derive(Debug, thiserror::Error)]
#[error("{path}: output: {problem}")]
pub struct OutputError {
    /// The output.
    pub path: PathBuf,
    /// Problem, and what to do about it.
    pub problem: String,
}

/// Files and folders that a command writes, to be compared with those that it reads.
#[derive(Debug, Default)]
pub struct Outputs<'a> {
    paths: Vec<&'a Path>,
}

impl<'a> Outputs<'a> {
    /// Outputs of a command; a folder stands for everything in it.
    pub fn new(paths: impl IntoIterator<Item = &'a Path>) -> Self {
        Self { paths: paths.into_iter().collect() }
    }

    /// Refuses an output that is an input, or is a folder that holds one, by whatever name or link it is called: the
    /// input would be lost. Names of inputs that are no paths, such as streams, are ignored.
    ///
    /// # Errors
    /// [`OutputError`] for the first such output, and for two outputs of one name.
    pub fn refuse<P: AsRef<Path>>(&self, inputs: impl IntoIterator<Item = P>) -> Result<(), OutputError> {
        let real: Vec<PathBuf> = self.paths.iter().map(|path| real_path(path)).collect();
        let refused = |i: usize, problem: String| OutputError { path: self.paths[i].to_owned(), problem };
        for i in 1..real.len() {
            if real[..i].contains(&real[i]) {
                return Err(refused(i, "is the same file as another output; name two".into()));
            }
        }
        for input in inputs {
            let input = input.as_ref();
            // A path that does not exist is no input that can be lost.
            let Ok(real_input) = input.canonicalize() else { continue };
            for (i, output) in real.iter().enumerate() {
                if *output == real_input || is_same_file(output, &real_input) {
                    return Err(refused(i, "is an input and would be lost; name another".into()));
                }
                if real_input.starts_with(output) {
                    let problem = format!(
                        "holds the input {}, which could be lost; name another folder",
                        input.display()
                    );
                    return Err(refused(i, problem));
                }
            }
        }
        Ok(())
    }
}

/// Refuses an output that is, or holds, one of these inputs.
///
/// # Errors
/// [`OutputError`] with the output and the mend.
pub fn refuse_inputs<P: AsRef<Path>>(
    output: &Path,
    inputs: impl IntoIterator<Item = P>,
) -> Result<(), OutputError> {
    Outputs::new([output]).refuse(inputs)
}

/// The path without links and detours. What does not exist yet is appended to the real path of the folder above it.
fn real_path(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    for above in absolute.ancestors() {
        if let Ok(real) = above.canonicalize() {
            let rest = absolute.strip_prefix(above).unwrap_or(Path::new(""));
            return if rest.as_os_str().is_empty() { real } else { real.join(rest) };
        }
    }
    absolute
}

/// Whether two paths are names of one file (hard links).
fn is_same_file(a: &Path, b: &Path) -> bool {
    let identity =
        |path: &Path| path.metadata().ok().filter(std::fs::Metadata::is_file).map(|m| (m.dev(), m.ino()));
    identity(a).is_some_and(|identity_of_a| Some(identity_of_a) == identity(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    #[test]
    fn an_input_is_no_output_by_any_name() {
        let folder = tempfile::tempdir().unwrap();
        let named = |name: &str| folder.path().join(name);
        fs::write(named("a.png"), "a").unwrap();
        fs::create_dir_all(named("deep/er")).unwrap();
        symlink("a.png", named("link.png")).unwrap();
        symlink(".", named("deep/up")).unwrap();
        fs::hard_link(named("a.png"), named("twin.png")).unwrap();
        let refusal = |output: &str, inputs: &[&str]| {
            let output = named(output);
            let inputs = inputs.iter().map(|input| named(input));
            Outputs::new([output.as_path()]).refuse(inputs).err().map(|e| e.to_string())
        };
        for output in ["a.png", "deep/../a.png", "link.png", "twin.png", "deep/up/../a.png"] {
            let line = refusal(output, &["b.png", "a.png"]).unwrap();
            assert!(line.contains("is an input") && line.contains("name another"), "{line}");
        }
        for output in ["b.png", "deep/a.png", "new/a.png", "deep"] {
            assert_eq!(refusal(output, &["b.png", "a.png", "rtsp://a.png"]), None, "{output}");
        }
        for (output, input) in [(".", "a.png"), ("deep", "deep/er"), ("deep/up", "deep/er"), ("deep", "deep")]
        {
            assert!(refusal(output, &[input]).is_some(), "{output} {input}");
        }
        assert_eq!(refusal("deep/er/out", &["deep/er", "deep"]), None, "a folder within an input holds none");
    }

    #[test]
    fn two_outputs_have_two_names() {
        let folder = tempfile::tempdir().unwrap();
        let [a, same] = ["a.txt", "new/../a.txt"].map(|name| folder.path().join(name));
        fs::create_dir(folder.path().join("new")).unwrap();
        let refuse = |paths: [&Path; 2]| Outputs::new(paths).refuse([Path::new("none")]);
        fs::write(&a, "").unwrap();
        assert!(refuse([&a, &same]).unwrap_err().to_string().contains("another output"));
        refuse([&a, &folder.path().join("b.txt")]).unwrap();
    }
}
