//! Films whose people are seen at other times than in another film.

use crate::offsets::CameraOffset;

/// Least offset between two films' people that is told, seconds.
const SHIFTED_S: f64 = 0.12;
/// Least offset that is told, standard deviations.
const SHIFTED_SIGMAS: f64 = 4.0;

/// Text of the finding that a camera's film begins earlier or later than that of its reference; `given_s` is the offset that was given
/// for it, seconds. `None` where the offset is small, or may be chance.
pub fn finding(camera: &str, reference: &str, given_s: f64, offset: &CameraOffset) -> Option<String> {
    let (offset_s, sigma_s) = (offset.offset_s, offset.sigma_s);
    // Both are false where a number is NaN.
    let is_told = offset_s.abs() >= SHIFTED_S && offset_s.abs() >= SHIFTED_SIGMAS * sigma_s;
    let option = format!("--offset {camera}={:.2}", given_s + offset_s);
    // An offset that is too uncertain to correct by may still be significant.
    let mend = if offset.is_known {
        format!("give {option}")
    } else {
        format!("give {option} at first, and a better one by something that both films show")
    };
    is_told.then(|| {
        format!(
            "by the people seen, its first frame was taken {offset_s:.2} ± {sigma_s:.2} s after that of `{reference}`: {mend}"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_beyond_chance_are_told_however_roughly_they_are_known() {
        let told = |offset_s: f64, sigma_s: f64, is_known: bool| {
            let offset = CameraOffset {
                reference: 0,
                offset_s,
                sigma_s,
                drift_ppm: 0.0,
                drift_sigma_ppm: 0.0,
                is_known,
            };
            finding("b", "a", 0.5, &offset)
        };
        let known = told(-1.5, 0.02, true).unwrap();
        assert!(
            known.contains("-1.50 ± 0.02 s after that of `a`") && known.ends_with("give --offset b=-1.00")
        );
        let rough = told(-1.5, 0.3, false).unwrap();
        assert!(rough.contains("--offset b=-1.00 at first"), "{rough}");
        // By chance; too small; nothing observed; an uncertainty that could not be computed.
        let none = [(-1.5, 0.4), (0.1, 0.001), (0.0, f64::INFINITY), (2.0, f64::NAN), (f64::NAN, 0.01)];
        assert!(none.iter().all(|(offset_s, sigma_s)| told(*offset_s, *sigma_s, false).is_none()));
    }
}
