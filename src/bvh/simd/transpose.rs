//! Triangles, one after the other → rows of their coordinates, with AVX.
//!
//! Macros, because functions might be called instead of inlined.

/// Of four triangles each of the coordinates 0 to 3, and in the upper halves 4 to 7.
macro_rules! of_four {
    ($a:expr, $b:expr, $c:expr, $d:expr) => {{
        let (a, b) = (_mm256_loadu_ps($a.as_ptr()), _mm256_loadu_ps($b.as_ptr()));
        let (c, d) = (_mm256_loadu_ps($c.as_ptr()), _mm256_loadu_ps($d.as_ptr()));
        let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
        let (ab_behind, cd_behind) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0x44>(ab, cd),
            _mm256_shuffle_ps::<0xee>(ab, cd),
            _mm256_shuffle_ps::<0x44>(ab_behind, cd_behind),
            _mm256_shuffle_ps::<0xee>(ab_behind, cd_behind),
        ]
    }};
}
pub(super) use of_four;

/// [`Octet::gather`](super::Octet::gather) for whoever may use AVX.
macro_rules! gather {
    () => {
        #[inline(always)]
        fn gather(_: Self::Proof, triangles: &[f32], ids: &[u32]) -> [[f32; 8]; 9] {
            let mut each = [&[0.0; 9]; 8];
            for (lane, triangle) in each.iter_mut().enumerate() {
                let start = ids[lane.min(ids.len() - 1)] as usize * 9;
                *triangle = triangles[start..start + 9].first_chunk().unwrap_or(triangle);
            }
            let mut rows = [[0.0; 8]; 9];
            // SAFETY: the proof is that of AVX. Each load is of the first eight of a triangle's nine floats, each
            // store to a row of eight; none needs alignment.
            unsafe {
                let low = of_four!(each[0], each[1], each[2], each[3]);
                let high = of_four!(each[4], each[5], each[6], each[7]);
                for i in 0..4 {
                    let (front, behind) = (rows[i].as_mut_ptr(), rows[i + 4].as_mut_ptr());
                    _mm256_storeu_ps(front, _mm256_permute2f128_ps::<0x20>(low[i], high[i]));
                    _mm256_storeu_ps(behind, _mm256_permute2f128_ps::<0x31>(low[i], high[i]));
                }
                let [a, b, c, d, e, f, g, h] = each;
                let last = _mm256_setr_ps(a[8], b[8], c[8], d[8], e[8], f[8], g[8], h[8]);
                _mm256_storeu_ps(rows[8].as_mut_ptr(), last);
            }
            rows
        }
    };
}
pub(super) use gather;
