//! Images in files: a folder of them, or the numbered ones of a printf pattern.

use std::path::{Path, PathBuf};

use ffmpeg::format::Pixel;
use ffmpeg::frame;
use image::{DynamicImage, RgbImage};

use super::name_order::sort_by_number;
use super::pixels::{self, Orientation, RgbBuffers};
use crate::{Error, Result, picture};

/// Images in the order in which they were taken, and the current position.
pub(super) struct Images {
    paths: Vec<PathBuf>,
    ahead: usize,
    decoded: Option<DecodedImage>,
    rgb: RgbBuffers,
}

/// The pixels of the image that was decoded last.
struct DecodedImage {
    /// Value of `Images::ahead` when these pixels were decoded: identifies their image.
    ahead: usize,
    pixels: RgbImage,
    /// The same pixels as an FFmpeg frame, made when another size is first asked for.
    frame: Option<frame::Video>,
}

impl Images {
    fn new(paths: Vec<PathBuf>) -> Self {
        Self { paths, ahead: 0, decoded: None, rgb: RgbBuffers::new() }
    }

    /// The images of a folder, in name order; numbers in the names count as numbers.
    pub(super) fn in_folder(folder: &Path) -> Result<Self> {
        let mut paths: Vec<PathBuf> = listed(folder)?.into_iter().filter(|path| is_image(path)).collect();
        let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        sort_by_number(&mut paths, name);
        if paths.is_empty() {
            return Err(Error::content(folder, "folder", "holds no .jpg, .jpeg or .png image"));
        }
        Ok(Self::new(paths))
    }

    /// The files of a pattern such as `frames/%04d.png`, from the lowest number on.
    ///
    /// # Errors
    /// A pattern that does not have one `%d`, no file for it, or a number that is left out between two others.
    pub(super) fn of_pattern(pattern: &str) -> Result<Self> {
        let path = Path::new(pattern);
        let (folder, name) = (path.parent().unwrap_or(Path::new("")), path.file_name().unwrap_or_default());
        let Some(name) = name.to_str().and_then(Numbered::parse) else {
            return Err(Error::content(
                path,
                "pattern",
                "the file's name needs one %d or %04d, where its number stands",
            ));
        };
        let listing = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let mut numbers: Vec<u64> =
            listed(listing)?.iter().filter_map(|file| name.number(file.file_name()?.to_str()?)).collect();
        numbers.sort_unstable();
        if numbers.is_empty() {
            return Err(Error::content(path, "pattern", "no file has such a name"));
        }
        if let Some(gap) = numbers.windows(2).find(|pair| pair[1] != pair[0] + 1) {
            let problem = format!("is missing, between {} and {}", name.name(gap[0]), name.name(gap[1]));
            return Err(Error::content(&folder.join(name.name(gap[0] + 1)), "pattern", &problem));
        }
        let paths = numbers.into_iter().map(|number| folder.join(name.name(number))).collect();
        Ok(Self::new(paths))
    }

    /// Number of images.
    pub(super) fn len(&self) -> usize {
        self.paths.len()
    }

    /// Path of the first image.
    pub(super) fn first(&self) -> &Path {
        // Opening fails without an image, so there is at least one.
        &self.paths[0]
    }

    /// Width and height of the first image, upright.
    pub(super) fn size(&self) -> Result<(u32, u32)> {
        picture::size(self.first())
    }

    /// Goes on to the next image. `false` when there are no more.
    pub(super) fn advance(&mut self) -> bool {
        let more = self.ahead < self.paths.len();
        self.ahead += usize::from(more);
        more
    }

    /// Path of the current image; call [`advance`](Self::advance) first.
    pub(super) fn path(&self) -> &Path {
        &self.paths[self.ahead - 1]
    }

    /// Decodes the current image and returns its width and height; call [`advance`](Self::advance) first.
    pub(super) fn decode(&mut self) -> Result<(u32, u32)> {
        Ok(self.decoded()?.pixels.dimensions())
    }

    /// Converts the current image into an image of any size; call [`advance`](Self::advance) first.
    pub(super) fn picture(&mut self, into: &mut RgbImage) -> Result<()> {
        let size = into.dimensions();
        let decoded = self.decoded()?;
        if decoded.pixels.dimensions() == size {
            into.copy_from_slice(&decoded.pixels);
            return Ok(());
        }
        let DecodedImage { pixels, frame, .. } = decoded;
        let frame = frame.take().unwrap_or_else(|| {
            let mut frame = frame::Video::new(Pixel::RGB24, pixels.width(), pixels.height());
            pixels::paste_rgb(pixels, &mut frame);
            frame
        });
        let scaled = self.rgb.picture(&frame, Orientation::UPRIGHT, into);
        if let Some(decoded) = &mut self.decoded {
            decoded.frame = Some(frame);
        }
        scaled.map_err(|error| Error::content(self.path(), "image", error.to_string()))
    }

    fn decoded(&mut self) -> Result<&mut DecodedImage> {
        let decoded = match self.decoded.take() {
            Some(decoded) if decoded.ahead == self.ahead => decoded,
            _ => {
                let pixels = match picture::read(self.path())? {
                    // Grey images are masks. `image` would convert their colour space pixel by pixel, which takes
                    // longer than all other work on a mask.
                    DynamicImage::ImageLuma8(grey) => {
                        let mut pixels = RgbImage::new(grey.width(), grey.height());
                        for (colour, level) in pixels.chunks_exact_mut(3).zip(grey.iter()) {
                            colour.fill(*level);
                        }
                        pixels
                    }
                    other => other.into_rgb8(),
                };
                DecodedImage { ahead: self.ahead, pixels, frame: None }
            }
        };
        Ok(self.decoded.insert(decoded))
    }
}

impl std::fmt::Debug for Images {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Images")
            .field("paths", &self.paths)
            .field("ahead", &self.ahead)
            .finish_non_exhaustive()
    }
}

/// A file's name with a number in it, as printf writes one.
struct Numbered<'a> {
    before: &'a str,
    digits: usize,
    after: &'a str,
}

impl<'a> Numbered<'a> {
    fn parse(pattern: &'a str) -> Option<Self> {
        let (before, rest) = pattern.split_once('%')?;
        let (width, after) = rest.split_once('d')?;
        let digits = if width.is_empty() { 0 } else { width.parse().ok()? };
        (!after.contains('%')).then_some(Self { before, digits, after })
    }

    fn name(&self, number: u64) -> String {
        format!("{}{number:0digits$}{}", self.before, self.after, digits = self.digits)
    }

    fn number(&self, name: &str) -> Option<u64> {
        let number = name.strip_prefix(self.before)?.strip_suffix(self.after)?.parse().ok()?;
        // `7` is not the name of `%04d`, nor is `+7`.
        (self.name(number) == name).then_some(number)
    }
}

fn listed(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(Error::io(folder))?;
    Ok(entries.filter_map(|entry| Some(entry.ok()?.path())).collect())
}

fn is_image(path: &Path) -> bool {
    path.extension()
        .and_then(|e| e.to_str())
        .is_some_and(|e| ["jpg", "jpeg", "png"].iter().any(|known| e.eq_ignore_ascii_case(known)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn a_pattern_is_a_name_with_one_number() {
        for (pattern, name, number) in [
            ("%04d.png", "0007.png", Some(7)),
            ("%04d.png", "7.png", None),
            ("%04d.png", "12345.png", Some(12345)),
            ("im%d.jpg", "im10.jpg", Some(10)),
            ("im%d.jpg", "im010.jpg", None),
            ("im%d.jpg", "im+1.jpg", None),
            ("im%d.jpg", "im.jpg", None),
        ] {
            assert_eq!(Numbered::parse(pattern).unwrap().number(name), number, "{pattern} {name}");
        }
        for no_pattern in ["a.png", "%s.png", "%d%d.png", "%-3d.png", "%"] {
            assert!(Numbered::parse(no_pattern).is_none(), "{no_pattern}");
        }
    }

    #[test]
    fn numbered_images_start_anywhere_and_have_no_gap() {
        let folder = tempfile::tempdir().unwrap();
        for number in [9, 10, 11] {
            RgbImage::from_pixel(4, 3, Rgb([number; 3]))
                .save(folder.path().join(format!("{number}.png")))
                .unwrap();
        }
        let pattern = folder.path().join("%d.png");
        let mut images = Images::of_pattern(pattern.to_str().unwrap()).unwrap();
        let mut picture = RgbImage::new(4, 3);
        for number in [9, 10, 11] {
            assert!(images.advance());
            images.picture(&mut picture).unwrap();
            assert_eq!(picture[(0, 0)][0], number);
        }
        assert!(!images.advance());
        std::fs::remove_file(folder.path().join("10.png")).unwrap();
        let said = Images::of_pattern(pattern.to_str().unwrap()).unwrap_err().to_string();
        assert!(said.contains("10.png") && said.contains("missing"), "{said}");
    }
}
