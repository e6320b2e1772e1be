//! Grey pictures in binary PGM (P5, 8 bits), which every camera tool can write.

use anyhow::{Context, Result, bail};

/// A grey picture, row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    pub width_px: usize,
    pub height_px: usize,
    pub pixels: Vec<u8>,
}

impl Picture {
    /// Reads a file's bytes.
    ///
    /// - Errors: another format than P5, more than 255 grey values, sides of 0 or above 4096, missing pixels.
    pub fn from_pgm(bytes: &[u8]) -> Result<Self> {
        let Some(mut rest) = bytes.strip_prefix(b"P5") else {
            bail!("not a binary PGM picture: it does not begin with P5; convert it to 8-bit grey PGM");
        };
        let mut numbers = [0_usize; 3];
        for (number, name) in numbers.iter_mut().zip(["width", "height", "largest value"]) {
            rest = skip_blank(rest);
            let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
            let (text, after) = rest.split_at(digits);
            *number = std::str::from_utf8(text)?
                .parse()
                .with_context(|| format!("the PGM's {name} is missing or too large"))?;
            rest = after;
        }
        let [width_px, height_px, largest] = numbers;
        if largest != 255 {
            bail!("the PGM's largest value is {largest}; give 8-bit pictures, 255");
        }
        if ![width_px, height_px].iter().all(|side| (1..=4096).contains(side)) {
            bail!("the PGM is {width_px} x {height_px} px; sides are 1 to 4096 px");
        }
        let pixels = rest.get(1..1 + width_px * height_px);
        let Some(pixels) = pixels else {
            bail!("the PGM ends before its {width_px} x {height_px} pixels");
        };
        Ok(Self {
            width_px,
            height_px,
            pixels: pixels.to_vec(),
        })
    }

    /// The file's bytes.
    pub fn to_pgm(&self) -> Vec<u8> {
        let mut out = format!("P5\n{} {}\n255\n", self.width_px, self.height_px).into_bytes();
        out.extend_from_slice(&self.pixels);
        out
    }
}

/// Without blanks and comments at its beginning.
fn skip_blank(mut bytes: &[u8]) -> &[u8] {
    loop {
        bytes = bytes.trim_ascii_start();
        if bytes.first() != Some(&b'#') {
            return bytes;
        }
        let end = bytes.iter().position(|byte| *byte == b'\n').unwrap_or(bytes.len());
        bytes = bytes.get(end..).unwrap_or_default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_come_back_and_comments_are_skipped() {
        let picture = Picture {
            width_px: 3,
            height_px: 2,
            pixels: vec![0, 10, b'#', b'\n', 200, 255],
        };
        assert_eq!(Picture::from_pgm(&picture.to_pgm()).expect("own file"), picture);
        let mut commented = b"P5 # made by hand\n# two\n3\t2 255\n".to_vec();
        commented.extend_from_slice(&picture.pixels);
        assert_eq!(Picture::from_pgm(&commented).expect("comments"), picture);
    }

    #[test]
    fn what_is_no_picture_is_refused_with_the_reason() {
        for (bytes, word) in [
            (&b"P6\n1 1\n255\n..."[..], "P5"),
            (b"P5\n1 x\n255\n.", "height"),
            (b"P5\n1 1\n65535\n..", "255"),
            (b"P5\n0 1\n255\n", "4096"),
            (b"P5\n4 4\n255\n....", "ends"),
            (b"P5\n99999999999999999999 1\n255\n", "width"),
        ] {
            let error = Picture::from_pgm(bytes).expect_err(word).to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
